#include "localize/site/join_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "calib/base/error.h"
#include "calib/base/union_find.h"
#include "calib/estimation/loss.h"
#include "calib/geo/geodetic.h"
#include "localize/references/view_turns.h"

namespace trigpoint {
namespace {

// Something that several runs show: its pose in the frame of a run.
struct Shared {
  std::string name;
  int reference = -1;  // of the run's solution; -1: a tag
  Rigid3d odom_from_x;
  double reach_m = 1;  // how far its axes count as points
};

std::vector<Shared> SharedOf(const SiteRun& run) {
  std::vector<Shared> shared;
  const Solution& s = run.solution;
  for (size_t i = 0; i < s.references.size(); ++i) {
    if (s.references[i].pose < 0 || s.references[i].status != "localized") continue;
    shared.push_back({s.references[i].name, static_cast<int>(i), OdomFromRig(s, s.references[i].pose), 1});
  }
  for (const WorldTag& tag : run.tags) {
    const int pose = run.input.images[static_cast<size_t>(tag.sightings.front().image)].pose;
    shared.push_back({fmt::format("tag {}", tag.id), -1, OdomFromRig(s, pose) * tag.body_from_tag, 0.3});
  }
  return shared;
}

// What the map's tags and control points show of where a run lies, in its own frame.
std::vector<Anchor> HeldBy(const SiteRun& run, const WorldEvidence& evidence) {
  std::vector<WorldTag> tags;
  for (const WorldTag& known : evidence.tags) {
    for (const WorldTag& tag : run.tags) {
      if (tag.id != known.id) continue;
      tags.push_back(tag);
      tags.back().world_from_tag = known.world_from_tag;
      tags.back().control = known.control;
    }
  }
  return AnchorsOf(run.input, tags, run.solution.problem);
}

std::array<Eigen::Vector3d, 4> PointsOf(const Rigid3d& frame_from_x, double reach) {
  std::array<Eigen::Vector3d, 4> points;
  points.fill(frame_from_x.translation);
  for (int k = 0; k < 3; ++k) {
    points[static_cast<size_t>(k)] += reach * (frame_from_x.rotation * Eigen::Vector3d::Unit(k));
  }
  return points;
}

// Of a run's position in the world, m^2; infinite without a georeference.
double Uncertainty(const Solution& s) {
  if (!s.georeference) return std::numeric_limits<double>::infinity();
  return s.georeference->covariance.diagonal().segment<3>(3).sum();
}

class Placing {
 public:
  Placing(const std::vector<SiteRun>& runs, const WorldEvidence& evidence) : runs_(runs) {
    for (const SiteRun& run : runs) {
      shared_.push_back(SharedOf(run));
      held_by_.push_back(HeldBy(run, evidence));
    }
  }

  // How many of a run's shared things lie somewhere already.
  size_t Known(size_t run) const {
    return static_cast<size_t>(std::count_if(shared_[run].begin(), shared_[run].end(),
                                             [&](const Shared& s) { return world_.count(s.name) > 0; }));
  }

  // Which of two runs is placed first: the one that shares most with those placed before, then the one that is known
  // best in the world, then the one that shows most of what holds the site.
  bool Before(size_t a, size_t b) const {
    const auto rank = [this](size_t run) {
      return std::tuple(Known(run), -Uncertainty(runs_[run].solution), held_by_[run].size());
    };
    return rank(a) > rank(b);
  }

  PlacedRun Place(size_t run, std::vector<std::string>* warnings) {
    const Solution& s = runs_[run].solution;
    PlacedRun placed;
    std::optional<Rigid3d> own;
    double scale = 1;
    if (s.georeference) {
      const Sim3d& geo = s.georeference->world_from_odom;
      own = Rigid3d(geo.rotation, geo.translation);
      scale = geo.scale;
    }
    std::vector<Anchor> anchors;
    std::vector<const Shared*> behind;
    for (const Shared& shared : shared_[run]) {
      const auto known = world_.find(shared.name);
      if (known == world_.end()) continue;
      Rigid3d metric = shared.odom_from_x;
      metric.translation *= scale;
      Anchor& anchor = anchors.emplace_back();
      for (const Eigen::Vector3d& p : PointsOf(metric, shared.reach_m)) anchor.odom.push_back(p);
      for (const Eigen::Vector3d& p : PointsOf(known->second, shared.reach_m)) anchor.world.push_back(p);
      behind.push_back(&shared);
    }
    if (anchors.empty() && !own) anchors = held_by_[run];
    std::string reason;
    std::optional<Rigid3d> pose = anchors.empty() ? own : PoseOfAnchors(anchors, own, &reason);
    if (!pose && !anchors.empty()) {
      const char* whom = behind.empty() ? "what holds the site" : "the runs before it";
      warnings->push_back(fmt::format("run {} cannot be placed by {}: {}; {}", runs_[run].name, whom, reason,
                                      own ? "it is placed by its own georeference" : "it is left out"));
      pose = own;
    }
    if (!pose) return placed;
    placed.world_from_odom = Sim3d{scale, pose->rotation, pose->translation};
    for (size_t k = 0; k < behind.size(); ++k) {
      const double off = AnchorDistance(anchors[k], *pose);
      if (off < kAnchorNear_m || behind[k]->reference < 0) continue;  // tags are tested by their corners
      placed.elsewhere.push_back(behind[k]->reference);
      warnings->push_back(
          fmt::format("{} lies {:.1f} m from where the other runs have it, by run {}: it is left out of "
                      "that run",
                      behind[k]->name, off, runs_[run].name));
    }
    for (const Shared& shared : shared_[run]) {
      world_.try_emplace(shared.name, placed.world_from_odom->TransformPose(shared.odom_from_x));
    }
    return placed;
  }

 private:
  const std::vector<SiteRun>& runs_;
  std::vector<std::vector<Shared>> shared_;
  std::vector<std::vector<Anchor>> held_by_;  // of each run
  std::map<std::string, Rigid3d> world_;      // where shared things lie
};

// The first view of each reference of a run's problem: each has its views in one row, behind those before it, and they
// follow the cameras. A reference that was rejected after the solution has lost its pose, but its observations and
// views are still in the problem.
std::map<int, int> FirstViews(const SiteRun& run) {
  const Solution& s = run.solution;
  std::map<int, int> least;  // view of a reference that is seen
  for (size_t k = 0; k < s.image_of.size(); ++k) {
    if (s.image_of[k] >= 0) continue;
    const int view = s.problem.observations[k].view;
    const auto [at, fresh] = least.try_emplace(-1 - s.image_of[k], view);
    at->second = std::min(at->second, view);
  }
  std::map<int, int> in_order;
  for (const auto& [reference, view] : least) in_order[view] = reference;
  std::map<int, int> first;
  int view = static_cast<int>(run.input.cameras.size());
  for (const auto& [seen, reference] : in_order) {
    first[reference] = view;
    view += static_cast<int>(run.input.references[static_cast<size_t>(reference)].rig.views.size());
  }
  return first;
}

// How views are tied to the pose of their panorama, by their own poses.
std::map<int, PoseFactor> TiesOf(const Solution& s) {
  std::map<int, PoseFactor> ties;
  for (const PoseFactor& f : s.problem.factors) {
    if (IsTie(f)) ties[f.a] = f;
  }
  return ties;
}

double Threshold(const std::shared_ptr<const ceres::LossFunction>& loss) {
  const auto* known = dynamic_cast<const Chi2Loss*>(loss.get());
  return known == nullptr ? std::numeric_limits<double>::infinity() : known->threshold();
}

// rig_from_world
Rigid3d InWorld(const Sim3d& world_from_odom, const Rigid3d& odom_from_rig) {
  return world_from_odom.TransformPose(odom_from_rig).Inverse();
}

// What holds a run where nothing else does: its first pose is as level as odometry has it, within `sigma`, and its
// height known to 10 km. The other poses follow by odometry.
PoseFactor Level(int pose, const Sim3d& world_from_odom, const Rigid3d& odom_from_rig, double sigma) {
  const Eigen::Matrix3d r = world_from_odom.rotation.toRotationMatrix();
  PoseFactor f;
  f.kind = PoseFactor::Kind::kGeotag;
  f.a = pose;
  f.measured.rotation =
      Eigen::AngleAxisd(std::atan2(r(1, 0), r(0, 0)), Eigen::Vector3d::UnitZ()) * odom_from_rig.rotation;
  f.measured.translation = world_from_odom.TransformPose(odom_from_rig).translation;
  f.sqrt_info.setZero();
  f.sqrt_info(0, 0) = f.sqrt_info(1, 1) = 1 / sigma;
  f.sqrt_info(5, 5) = 1 / kUnknownHeightSigma;
  return f;
}

// Throws InputError unless the solution is one of this input.
void CheckSame(const SiteRun& run) {
  const Solution& s = run.solution;
  const auto image = [](const SolutionImage& a, const FrameImage& b) {
    return a.stamp_ns == b.stamp_ns && a.pose == b.pose;
  };
  const auto reference = [](const SolutionReference& a, const ReferenceViews& b) { return a.name == b.name; };
  if (std::equal(s.images.begin(), s.images.end(), run.input.images.begin(), run.input.images.end(), image) &&
      std::equal(s.references.begin(), s.references.end(), run.input.references.begin(), run.input.references.end(),
                 reference)) {
    return;
  }
  throw InputError("the solution of run " + run.name +
                   " holds other images or panoramas than the project has now: run `trigpoint localize` again");
}

class Joiner {
 public:
  Joiner(double tilt_sigma_rad, JoinedRuns* out)
      : tilt_sigma_rad_(tilt_sigma_rad), out_(*out), r_(out->reconstruction), p_(out->reconstruction.problem) {
    p_.scales.clear();
  }

  void AddInput(const SiteRun& run, int index) {
    LocalizeInput& all = out_.input;
    const LocalizeInput& one = run.input;
    CheckSame(run);
    SolutionRun& part = out_.runs.emplace_back();
    part.name = run.name;
    part.first_camera = static_cast<int>(all.cameras.size());
    part.first_image = static_cast<int>(all.images.size());
    part.first_pose = static_cast<int>(all.pose_stamps.size());
    part.sigma_px = run.solution.sigma_px;
    part.correlation_inflation = run.solution.correlation_inflation;
    part.odometry_noise_factor = run.solution.odometry_noise_factor;
    all.cameras.insert(all.cameras.end(), one.cameras.begin(), one.cameras.end());
    for (FrameImage image : one.images) {
      image.camera += part.first_camera;
      image.pose += part.first_pose;
      all.images.push_back(image);
      out_.run_of_image.push_back(index);
    }
    all.pose_stamps.insert(all.pose_stamps.end(), one.pose_stamps.begin(), one.pose_stamps.end());
    all.odom_from_body.insert(all.odom_from_body.end(), one.odom_from_body.begin(), one.odom_from_body.end());
    for (const BodyCamera& camera : one.cameras) p_.views.push_back(camera.cam_from_body);
  }

  // The run's part of the problem; views of the cameras and all body poses have their places already.
  void AddProblem(SiteRun* run, int index, const PlacedRun& placed) {
    const SolutionRun& part = out_.runs[static_cast<size_t>(index)];
    const Solution& s = run->solution;
    const Sim3d& world_from_odom = *placed.world_from_odom;
    const int bodies = static_cast<int>(s.pose_stamps.size());
    for (int k = 0; k < bodies; ++k) {
      p_.poses[static_cast<size_t>(part.first_pose + k)] = InWorld(world_from_odom, OdomFromRig(s, k));
    }
    for (PoseFactor f : s.problem.factors) {
      const bool own = f.kind == PoseFactor::Kind::kBetween || f.kind == PoseFactor::Kind::kTwoView;
      if (!own || f.a >= bodies || f.b >= bodies) continue;
      f.a += part.first_pose, f.b += part.first_pose;
      f.view_a += part.first_camera, f.view_b += part.first_camera;
      if (f.scale >= 0) f.scale = index;
      p_.factors.push_back(f);
    }
    p_.factors.push_back(Level(part.first_pose, world_from_odom, OdomFromRig(s, 0),
                               run->input.levelled ? kLevelled_rad : tilt_sigma_rad_));
    OdometryScale& scale = p_.scales.emplace_back();
    scale.value = s.problem.scales.front().value * world_from_odom.scale;
    scale.constant = false;
    const bool metric = run->input.has_odometry || run->input.scale_sigma < 1;  // by its cameras' places on the body
    scale.prior = metric ? 1 : scale.value;
    scale.sigma = run->input.scale_sigma * scale.prior;
    const int first_point = static_cast<int>(p_.points.size());
    for (const Eigen::Vector3d& y : s.problem.points) {
      p_.points.push_back(world_from_odom * y);
      out_.run_of_point.push_back(index);
    }
    r_.depth_m.insert(r_.depth_m.end(), s.depth_m.begin(), s.depth_m.end());
    r_.point_valid.insert(r_.point_valid.end(), s.point_valid.begin(), s.point_valid.end());
    r_.dropped_observations += s.dropped_observations;
    AddReferences(*run, index, placed);
    NoteTurns(*run);
    AddObservations(*run, index, first_point);
    run->solution = {};
    run->solution.run = part.name;
  }

  // Views of the panoramas that any run has turned: all runs that see one see the same turn.
  void FreeTurnedViews() {
    const auto of = [this](size_t k) -> std::optional<ViewToFree> {
      const int rig = p_.observations[k].pose;
      const auto sigma = turn_sigma_.find(rig);
      if (sigma == turn_sigma_.end()) return std::nullopt;
      const auto turn = turns_.find({rig, out_.view_of[k]});
      return ViewToFree{out_.view_of[k], sigma->second, turn == turns_.end() ? Rigid3d() : turn->second};
    };
    FreeViews(of, &p_);
  }

 private:
  struct Local {
    int id = -1;  // of the joint references
    int old_view = 0, new_view = 0;
  };

  // Poses and views of the references that the run has localized.
  void AddReferences(const SiteRun& run, int index, const PlacedRun& placed) {
    const std::map<int, int> first_views = FirstViews(run);
    local_.clear();
    for (size_t i = 0; i < run.solution.references.size(); ++i) {
      const SolutionReference& one = run.solution.references[i];
      const auto [at, fresh] = reference_.try_emplace(one.name, static_cast<int>(out_.references.size()));
      if (fresh) {
        out_.references.push_back(one);
        out_.references.back().pose = -1;
        out_.input.references.push_back(run.input.references[i]);
        out_.runs_of_reference.emplace_back();
      }
      const int id = at->second;
      SolutionReference& joint = out_.references[static_cast<size_t>(id)];
      const bool elsewhere =
          std::find(placed.elsewhere.begin(), placed.elsewhere.end(), static_cast<int>(i)) != placed.elsewhere.end();
      const bool taken = one.pose >= 0 && one.status == "localized" && !elsewhere;
      local_.push_back({taken ? id : -1, 0, 0});
      if (!taken) continue;
      if (joint.pose < 0) {
        joint = one;
        joint.pose = static_cast<int>(p_.poses.size());
        p_.poses.push_back(InWorld(*placed.world_from_odom, OdomFromRig(run.solution, one.pose)));
      } else {
        joint.view_matches += one.view_matches;
        joint.agreeing += one.agreeing;
        joint.distance_m = std::min(joint.distance_m, one.distance_m);
      }
      const auto first = first_views.find(static_cast<int>(i));
      local_.back().old_view = first == first_views.end() ? 0 : first->second;
      local_.back().new_view = static_cast<int>(p_.views.size());
      for (size_t v = 0; v < run.input.references[i].rig.views.size(); ++v) {
        p_.views.push_back(run.solution.problem.views[static_cast<size_t>(local_.back().old_view) + v]);
      }
      out_.runs_of_reference[static_cast<size_t>(id)].push_back(index);
    }
  }

  // How the run has views turned against their panoramas.
  void NoteTurns(const SiteRun& run) {
    const Solution& s = run.solution;
    const std::map<int, PoseFactor> ties = TiesOf(s);
    for (size_t k = 0; !ties.empty() && k < s.problem.observations.size(); ++k) {
      const BearingObservation& o = s.problem.observations[k];
      const auto tie = ties.find(o.pose);
      if (tie == ties.end()) continue;
      const Local& local = local_[static_cast<size_t>(-1 - s.image_of[k])];
      if (local.id < 0) continue;
      const int rig = out_.references[static_cast<size_t>(local.id)].pose;
      const auto pose = [&](int of) { return s.problem.poses[static_cast<size_t>(of)]; };
      turns_.try_emplace({rig, o.view - local.old_view}, pose(o.pose) * pose(tie->second.b).Inverse());
      double& sigma = turn_sigma_[rig];
      sigma = std::max(sigma, SigmaOfTie(tie->second));
    }
  }

  void AddObservations(const SiteRun& run, int index, int first_point) {
    const Solution& s = run.solution;
    const SolutionRun& part = out_.runs[static_cast<size_t>(index)];
    for (size_t k = 0; k < s.problem.observations.size(); ++k) {
      BearingObservation o = s.problem.observations[k];
      int image = s.image_of[k], view_of = -1;
      if (image >= 0) {
        o.pose += part.first_pose, o.view += part.first_camera;
        image += part.first_image;
      } else {
        const Local& local = local_[static_cast<size_t>(-1 - image)];
        if (local.id < 0) continue;
        view_of = o.view - local.old_view;
        o.pose = out_.references[static_cast<size_t>(local.id)].pose;
        o.view = local.new_view + view_of;
        image = -1 - local.id;
      }
      o.point += first_point;
      p_.observations.push_back(o);
      r_.image_of.push_back(image);
      r_.feature_of.push_back(s.feature_of[k]);
      out_.view_of.push_back(view_of);
    }
  }

  double tilt_sigma_rad_;
  JoinedRuns& out_;
  Reconstruction& r_;
  BundleProblem& p_;
  std::map<std::string, int> reference_;
  std::map<std::pair<int, int>, Rigid3d> turns_;  // of a panorama's pose and its view: own pose from it
  std::map<int, double> turn_sigma_;              // rad, of a panorama's pose, by the run that has the largest turns
  std::vector<Local> local_;                      // of the run that is added
};

// Joins the groups of points that `root` names.
class Merger {
 public:
  explicit Merger(JoinedRuns* joined) : j_(*joined), p_(joined->reconstruction.problem) {
    first_.assign(p_.points.size() + 1, 0);
    for (const BearingObservation& o : p_.observations) ++first_[static_cast<size_t>(o.point) + 1];
    for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  }

  // The group as one point, with what it was seen by; each feature of a panorama counts once, an observation that is
  // believed before one that is not. False where two features of one picture would be the point: a match is wrong.
  bool Add(const std::vector<int>& group, BundleProblem* trial, std::vector<size_t>* of) const {
    std::map<std::pair<int, int>, int> feature_of;  // image or reference, view
    bool good = true;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int member : group) mean += p_.points[static_cast<size_t>(member)] / static_cast<double>(group.size());
    for (const bool believed : {true, false}) {
      for (int member : group) good = AddSeen(member, believed, &feature_of, trial, of) && good;
    }
    trial->points.push_back(mean);
    return good;
  }

 private:
  bool AddSeen(int member, bool believed, std::map<std::pair<int, int>, int>* feature_of, BundleProblem* trial,
               std::vector<size_t>* of) const {
    const Reconstruction& r = j_.reconstruction;
    bool good = true;
    for (int k = first_[static_cast<size_t>(member)]; k < first_[static_cast<size_t>(member) + 1]; ++k) {
      const auto i = static_cast<size_t>(k);
      if (p_.observations[i].active != believed) continue;
      const auto [at, fresh] = feature_of->try_emplace({r.image_of[i], j_.view_of[i]}, r.feature_of[i]);
      if (!fresh) {
        good = good && (at->second == r.feature_of[i] || !believed);
        continue;
      }
      trial->observations.push_back(p_.observations[i]);
      trial->observations.back().point = static_cast<int>(trial->points.size());
      of->push_back(i);
    }
    return good;
  }

  const JoinedRuns& j_;
  const BundleProblem& p_;
  std::vector<int> first_;
};

// Groups of points by pairs.
std::vector<std::vector<int>> GroupsOf(const PointPairs& pairs, const JoinedRuns& joined) {
  UnionFind sets(static_cast<int>(joined.run_of_point.size()));
  std::set<int> named;
  for (const auto& [a, b] : pairs) {
    sets.Join(a, b);
    named.insert(a), named.insert(b);
  }
  std::map<int, std::vector<int>> groups;
  for (int point : named) groups[sets.Root(point)].push_back(point);
  std::vector<std::vector<int>> out;
  for (auto& [root, members] : groups) {
    if (members.size() > 1) out.push_back(std::move(members));
  }
  return out;
}

double InflationOf(const JoinedRuns& joined, int point) {
  return joined.runs[static_cast<size_t>(joined.run_of_point[static_cast<size_t>(point)])].correlation_inflation;
}

// Observations as `keep` says, sorted by point.
void SortObservations(const std::vector<bool>& keep, JoinedRuns* joined) {
  Reconstruction& r = joined->reconstruction;
  std::vector<size_t> order;
  for (size_t k = 0; k < keep.size(); ++k) {
    if (keep[k]) order.push_back(k);
  }
  const auto& observations = r.problem.observations;
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return observations[a].point < observations[b].point; });
  const auto take = [&](auto* values) {
    auto sorted = *values;
    sorted.resize(order.size());
    for (size_t k = 0; k < order.size(); ++k) sorted[k] = (*values)[order[k]];
    values->swap(sorted);
  };
  take(&r.image_of);
  take(&r.feature_of);
  take(&joined->view_of);
  take(&r.problem.observations);
}

}  // namespace

std::vector<PlacedRun> PlaceRuns(const std::vector<SiteRun>& runs, const WorldEvidence& evidence,
                                 std::vector<std::string>* warnings) {
  Placing placing(runs, evidence);
  std::vector<PlacedRun> placed(runs.size());
  std::vector<bool> done(runs.size(), false);
  for (size_t step = 0; step < runs.size(); ++step) {
    size_t next = runs.size();
    for (size_t i = 0; i < runs.size(); ++i) {
      if (!done[i] && (next == runs.size() || placing.Before(i, next))) next = i;
    }
    done[next] = true;
    placed[next] = placing.Place(next, warnings);
  }
  return placed;
}

JoinedRuns JoinRuns(std::vector<SiteRun>* runs, const std::vector<PlacedRun>& placed, double tilt_sigma_rad) {
  JoinedRuns out;
  Joiner joiner(tilt_sigma_rad, &out);
  int index = 0;
  std::vector<std::function<FeatureSet(int)>> features;
  for (const SiteRun& run : *runs) {
    joiner.AddInput(run, index++);
    features.push_back(run.input.image_features);
  }
  out.input.image_features = [features, run_of = out.run_of_image, runs_of = out.runs](int image) {
    const auto run = static_cast<size_t>(run_of[static_cast<size_t>(image)]);
    return features[run](image - runs_of[run].first_image);
  };
  Reconstruction& r = out.reconstruction;
  BundleProblem& p = r.problem;
  p.poses.resize(out.input.pose_stamps.size());
  // One kernel for all: the widest, as observations that are none have been set aside run by run.
  p.loss = runs->front().solution.problem.loss;
  for (const SiteRun& run : *runs) {
    if (Threshold(run.solution.problem.loss) > Threshold(p.loss)) p.loss = run.solution.problem.loss;
  }
  for (size_t i = 0; i < runs->size(); ++i) {
    joiner.AddProblem(&(*runs)[i], static_cast<int>(i), placed[i]);
  }
  joiner.FreeTurnedViews();
  p.pose_constant.assign(p.poses.size(), false);
  out.input.has_frame = true;
  out.input.frame = runs->front().input.frame;
  const SolutionRun& one = out.runs.front();
  r.sigma_px = one.sigma_px;
  r.correlation_inflation = one.correlation_inflation;
  r.odometry_noise_factor = one.odometry_noise_factor;
  return out;
}

PointPairs PairsByPanoramas(const JoinedRuns& joined) {
  const Reconstruction& r = joined.reconstruction;
  // One feature shows two spots where it is aligned with images of two runs (references/align_views.h), which do not
  // lie in one place: 1 % of those that do are farther apart, with the noise of both.
  constexpr double kMostChi2 = 2 * 9.21;
  std::map<std::array<int, 3>, size_t> first_of;  // reference, view, feature
  PointPairs pairs;
  for (size_t k = 0; k < r.image_of.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    if (r.image_of[k] >= 0 || !o.active) continue;
    const auto [at, fresh] = first_of.try_emplace({r.image_of[k], joined.view_of[k], r.feature_of[k]}, k);
    if (fresh) continue;
    const BearingObservation& first = r.problem.observations[at->second];
    const double apart = (first.w * o.ray.normalized()).squaredNorm();
    if (first.point != o.point && apart < kMostChi2) pairs.emplace_back(first.point, o.point);
  }
  return pairs;
}

int MergePoints(const PointPairs& pairs, double outlier_chi2, JoinedRuns* joined, int threads,
                const CancelToken& cancel) {
  Reconstruction& r = joined->reconstruction;
  BundleProblem& p = r.problem;
  const std::vector<std::vector<int>> groups = GroupsOf(pairs, *joined);
  const Merger merger(joined);
  BundleProblem trial;
  trial.poses = p.poses;
  trial.views = p.views;
  std::vector<size_t> of;  // of each observation of the trial
  std::vector<bool> good;
  for (const std::vector<int>& group : groups) good.push_back(merger.Add(group, &trial, &of));
  OptimizePoints(trial, 10, threads, cancel);
  for (size_t k = 0; k < of.size(); ++k) {
    const BearingObservation& o = trial.observations[k];
    const double inflation = InflationOf(*joined, p.observations[of[k]].point);
    // Those of references have a gate of their own, a wider one.
    const double most = outlier_chi2 * (r.image_of[of[k]] < 0 ? 4 : 1 / (inflation * inflation));
    if (o.active && SquaredError(trial, o) > most) good[static_cast<size_t>(o.point)] = false;
  }
  std::vector<bool> keep(p.observations.size(), true), gone(p.points.size(), false);
  int merged = 0;
  for (size_t g = 0; g < groups.size(); ++g) {
    if (!good[g]) continue;
    p.points[static_cast<size_t>(groups[g].front())] = trial.points[g];
    for (size_t m = 1; m < groups[g].size(); ++m, ++merged) gone[static_cast<size_t>(groups[g][m])] = true;
  }
  for (size_t k = 0; k < p.observations.size(); ++k) {
    keep[k] = !gone[static_cast<size_t>(p.observations[k].point)];
  }
  for (size_t k = 0; k < of.size(); ++k) {
    const auto group = static_cast<size_t>(trial.observations[k].point);
    if (!good[group]) continue;
    p.observations[of[k]].point = groups[group].front();
    keep[of[k]] = true;
  }
  // A feature of a panorama that two members have is kept once: that of the first.
  for (size_t i = 0; i < gone.size(); ++i) {
    if (gone[i]) r.point_valid[i] = false;
  }
  SortObservations(keep, joined);
  return merged;
}

}  // namespace trigpoint
