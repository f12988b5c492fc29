#include "localize/georegistration/world_fit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/loss.h"
#include "calib/geometry/alignment.h"

namespace trigpoint {
namespace {

constexpr double kCornerChi2 = 9.21;   // 99 %, 2 degrees of freedom
constexpr double kMovedChi2 = 35;      // of 6: the survey's own limit for a tag that stands elsewhere
constexpr double kControlChi2 = 11.3;  // 99 %, 3 degrees of freedom

std::optional<Rigid3d> Align(const std::vector<const Anchor*>& anchors) {
  std::vector<Eigen::Vector3d> odom, world;
  for (const Anchor* anchor : anchors) {
    odom.insert(odom.end(), anchor->odom.begin(), anchor->odom.end());
    world.insert(world.end(), anchor->world.begin(), anchor->world.end());
  }
  try {
    const Sim3d s = AlignPoints(odom, world, odom.size() < 3 ? AlignmentKind::kYawTranslation : AlignmentKind::kSE3);
    return Rigid3d(s.rotation, s.translation);
  } catch (const NumericError&) {
    return std::nullopt;
  }
}

Matrix6d Rows(double rx, double ry, double rz, double x, double y, double z) {
  Matrix6d m = Matrix6d::Zero();
  m.diagonal() << rx, ry, rz, x, y, z;
  return m;
}

std::shared_ptr<const ceres::LossFunction> Dcs(double chi2) { return std::make_shared<DcsLoss>(chi2); }

// Weights that let fixes within `correlation_s` count as one: each has the part of that time which it stands for.
std::vector<double> GpsWeights(const std::vector<GpsPlace>& gps, double correlation_s) {
  std::vector<double> weights(gps.size(), 1);
  if (correlation_s <= 0) return weights;
  double sum = 0;
  for (size_t i = 0; i < gps.size(); ++i) {
    const int64_t before = i > 0 ? gps[i].stamp_ns - gps[i - 1].stamp_ns : 0;
    const int64_t after = i + 1 < gps.size() ? gps[i + 1].stamp_ns - gps[i].stamp_ns : 0;
    weights[i] = std::min(1.0, 0.5e-9 * static_cast<double>(before + after) / correlation_s);
    sum += weights[i];
  }
  // However short a run is, its fixes together count as one at least.
  for (double& w : weights) w = sum >= 1 ? w : sum > 0 ? w / sum : 1.0 / static_cast<double>(gps.size());
  return weights;
}

class Fitter {
 public:
  Fitter(const LocalizeInput& input, const WorldEvidence& evidence, const GeoRegistrationOptions& options,
         const BundleOptions& bundle, BundleProblem* problem, ProgressSink& progress, const CancelToken& cancel)
      : input_(input),
        evidence_(evidence),
        options_(options),
        bundle_(bundle),
        p_(*problem),
        progress_(progress),
        cancel_(cancel) {}

  void AddFrame(const Rigid3d& world_from_odom, WorldFit* fit);
  void AddTags(WorldFit* fit);
  void AddGeotags(const GeoStart& start, WorldFit* fit);
  // Of one run of `runs` that have GPS.
  void AddGps(const std::vector<GpsPlace>& gps, int runs, WorldFit* fit);
  BundleSummary Solve() { return SolveBundle(p_, bundle_, progress_, cancel_); }
  // With robust kernels for geotags and GPS only: at the start, correct observations may be many sigmas off.
  void SolveFromFarOff(const std::vector<PoseFactor>& links);
  // With the corners' own noise, and without tags that contradict the map.
  void SolveWithMap(WorldFit* fit, BundleSummary* summary);
  // Takes the tag apart that a run's images contradict most; false if there is none.
  bool LeaveOutMoved(const std::vector<int>& run_of_image, std::vector<TagInRun>* moved);

 private:
  int AddPose(const Rigid3d& pose) {
    p_.poses.push_back(pose);
    if (!p_.pose_constant.empty()) p_.pose_constant.push_back(false);
    return static_cast<int>(p_.poses.size()) - 1;
  }
  // A factor of pose a whose world is that of the frame.
  PoseFactor& AddPlace(PoseFactor::Kind kind, int a, const Rigid3d& measured, const Matrix6d& sqrt_info) {
    PoseFactor f;
    f.kind = kind;
    f.a = a;
    f.b = frame_;
    f.measured = measured;
    f.sqrt_info = sqrt_info;
    p_.factors.push_back(f);
    return p_.factors.back();
  }
  Rigid3d Frame() const { return frame_ < 0 ? Rigid3d() : p_.poses[static_cast<size_t>(frame_)]; }
  void SetMap();
  void WeighCorners();
  // Leaves the worst tag out of the map; false if all agree with it.
  bool LeaveOutWorst(WorldFit* fit);

  const LocalizeInput& input_;
  const WorldEvidence& evidence_;
  const GeoRegistrationOptions& options_;
  const BundleOptions& bundle_;
  BundleProblem& p_;
  ProgressSink& progress_;
  const CancelToken& cancel_;
  int frame_ = -1;
  size_t first_corner_ = 0, corners_ = 0;  // among the factors
  std::vector<int> pose_of_tag_;
  std::vector<size_t> in_map_;        // indices into evidence_.tags
  std::vector<Eigen::Index> row_of_;  // of each tag in map_covariance, -1: not in it
};

void Fitter::AddFrame(const Rigid3d& world_from_odom, WorldFit* fit) {
  fit->frame = frame_ = AddPose(world_from_odom);
  // Weak priors for what no observation fixes: the tilt as in odometry, the height within 10 km.
  const Eigen::Matrix3d r = world_from_odom.rotation.toRotationMatrix();
  PoseFactor level;
  level.a = frame_;
  level.measured.rotation = Eigen::AngleAxisd(std::atan2(r(1, 0), r(0, 0)), Eigen::Vector3d::UnitZ());
  level.measured.translation = world_from_odom.translation;
  const double tilt = 1 / (input_.levelled ? kLevelled_rad : options_.tilt_sigma_deg * kDegToRad);
  level.sqrt_info = Rows(tilt, tilt, 0, 0, 0, 1 / kUnknownHeightSigma);
  p_.factors.push_back(level);
  OdometryScale& scale = p_.scales.front();
  scale.constant = false;
  scale.prior = 1;
  scale.sigma = input_.scale_sigma;
}

void Fitter::AddTags(WorldFit* fit) {
  first_corner_ = p_.factors.size();
  fit->first_tag = static_cast<int>(p_.poses.size());
  Eigen::Index row = 0;
  for (size_t t = 0; t < evidence_.tags.size(); ++t) {
    const WorldTag& tag = evidence_.tags[t];
    const int seen_from = input_.images[static_cast<size_t>(tag.sightings.front().image)].pose;
    const Rigid3d body_from_odom = p_.poses[static_cast<size_t>(seen_from)];
    const int pose = AddPose(tag.body_from_tag.Inverse() * body_from_odom);
    pose_of_tag_.push_back(pose);
    for (const TagSighting& s : tag.sightings) {
      const FrameImage& image = input_.images[static_cast<size_t>(s.image)];
      for (size_t k = 0; k < 4; ++k) {
        PoseFactor corner;
        corner.kind = PoseFactor::Kind::kRigPoint;
        corner.a = image.pose;
        corner.b = pose;
        corner.view_a = image.camera;
        corner.arm = tag.corners[k];
        corner.measured.translation = s.rays[k];
        corner.sqrt_info.setZero();
        corner.sqrt_info.topLeftCorner<2, 3>() = s.w[k];
        corner.loss = Dcs(kCornerChi2);
        p_.factors.push_back(corner);
      }
    }
    row_of_.push_back(tag.world_from_tag ? row : -1);
    if (tag.world_from_tag) row += 6, in_map_.push_back(t);
  }
  corners_ = p_.factors.size() - first_corner_;
  for (size_t t = 0; t < evidence_.tags.size(); ++t) {
    for (const TagControl& control : evidence_.tags[t].control) {
      const Matrix6d info = Rows(0, 0, 0, 1 / control.sigma_h_m, 1 / control.sigma_h_m, 1 / control.sigma_v_m);
      PoseFactor& f = AddPlace(PoseFactor::Kind::kPosition, pose_of_tag_[t], {}, info);
      f.arm = control.in_tag;
      f.measured.translation = control.position;
      f.loss = Dcs(kControlChi2);
    }
    if (!evidence_.tags[t].control.empty()) fit->control_tags.push_back(evidence_.tags[t].id);
  }
  SetMap();
}

// The map of the tags that are believed: their joint covariance is that part of the whole.
void Fitter::SetMap() {
  p_.map.reset();
  if (in_map_.empty()) return;
  MapFactor& map = p_.map.emplace();
  map.frame = frame_;
  const auto n = static_cast<Eigen::Index>(in_map_.size());
  Eigen::MatrixXd c(6 * n, 6 * n);
  for (Eigen::Index a = 0; a < n; ++a) {
    const size_t tag = in_map_[static_cast<size_t>(a)];
    map.rigs.push_back(pose_of_tag_[tag]);
    map.measured.push_back(*evidence_.tags[tag].world_from_tag);
    for (Eigen::Index b = 0; b < n; ++b) {
      c.block<6, 6>(6 * a, 6 * b) =
          evidence_.map_covariance.block<6, 6>(row_of_[tag], row_of_[in_map_[static_cast<size_t>(b)]]);
    }
  }
  c.diagonal() *= 1 + 1e-9;  // tables are rounded
  const Eigen::LLT<Eigen::MatrixXd> llt(c);
  if (llt.info() != Eigen::Success) throw NumericError("the covariance of the tag map is not positive definite");
  map.sqrt_info = llt.matrixL().solve(Eigen::MatrixXd::Identity(6 * n, 6 * n));
}

void Fitter::AddGeotags(const GeoStart& start, WorldFit* fit) {
  for (size_t i = 0; i < start.observations.size(); ++i) {
    const GeoObservation& o = start.observations[i];
    if (start.references[i] < 0) continue;
    fit->geotags = true;
    const int pose = start.poses[i];
    if (o.has_position) {
      const double v = o.has_height ? 1 / o.sigma_v_m : 0;
      const Matrix6d info = Rows(0, 0, 0, 1 / o.sigma_h_m, 1 / o.sigma_h_m, v);
      AddPlace(PoseFactor::Kind::kPosition, pose, Rigid3d(Eigen::Quaterniond::Identity(), o.position), info).loss =
          Dcs(options_.loss_chi2);
    }
    const Attitude now = AttitudeOf((Frame() * p_.poses[static_cast<size_t>(pose)].Inverse()).rotation);
    if ((!o.has_heading && !o.has_tilt) || std::cos(now.pitch_rad) < 0.05) continue;
    Attitude said = o.attitude;
    if (!o.has_heading) said.heading_rad = now.heading_rad;
    if (!o.has_tilt) said.pitch_rad = now.pitch_rad, said.roll_rad = now.roll_rad;
    const double tilt = o.has_tilt ? 1 / o.sigma_tilt_rad : 0, heading = o.has_heading ? 1 / o.sigma_heading_rad : 0;
    AddPlace(PoseFactor::Kind::kGeotag, pose, Rigid3d(WorldFromCamRotation(said), Eigen::Vector3d::Zero()),
             Rows(tilt, tilt, heading, 0, 0, 0))
        .loss = Dcs(options_.loss_chi2);
  }
}

void Fitter::AddGps(const std::vector<GpsPlace>& gps, int runs, WorldFit* fit) {
  const std::vector<double> weights = GpsWeights(gps, options_.gps_correlation_s);
  const double root_sum = std::sqrt(runs * std::max(1.0, std::accumulate(weights.begin(), weights.end(), 0.0)));
  for (size_t i = 0; i < gps.size(); ++i) {
    const GpsPlace& g = gps[i];
    if (!(weights[i] > 0)) continue;
    const double root = std::sqrt(weights[i]);
    // An error that all heights share counts once, however many fixes there are.
    const double root_v = g.sigma_sea_m > 0 ? root / root_sum : root;
    const double v = g.sigma_v_m < kUnknownHeightSigma ? root_v / g.sigma_v_m : 0;
    PoseFactor& f = AddPlace(PoseFactor::Kind::kPosition, g.pose, Rigid3d(Eigen::Quaterniond::Identity(), g.position),
                             Rows(0, 0, 0, root / g.sigma_h_m, root / g.sigma_h_m, v));
    f.arm = g.arm_m;
    f.loss = Dcs(weights[i] * options_.loss_chi2);
    fit->gps = true;
  }
}

void Fitter::SolveFromFarOff(const std::vector<PoseFactor>& links) {
  const auto loss = p_.loss;
  const auto set_corners = [&](const std::shared_ptr<const ceres::LossFunction>& of_corners) {
    for (size_t i = first_corner_; i < first_corner_ + corners_; ++i) p_.factors[i].loss = of_corners;
  };
  const size_t factors = p_.factors.size();
  p_.factors.insert(p_.factors.end(), links.begin(), links.end());
  p_.loss = nullptr;
  set_corners(nullptr);
  Solve();
  p_.factors.resize(factors);
  p_.loss = loss;
  set_corners(Dcs(kCornerChi2));
}

void Fitter::SolveWithMap(WorldFit* fit, BundleSummary* summary) {
  WeighCorners();
  *summary = Solve();
  while (LeaveOutWorst(fit)) *summary = Solve();
  for (const WorldTag& tag : evidence_.tags) {
    const bool out = std::find(fit->left_out.begin(), fit->left_out.end(), tag.id) != fit->left_out.end();
    if (tag.world_from_tag && !out) fit->map_tags.push_back(tag.id);
  }
  if (2 * fit->left_out.size() > fit->left_out.size() + fit->map_tags.size()) {
    fit->warnings.push_back(
        fmt::format("{} of {} tags in the run's images stand elsewhere than in the map: check that "
                    "the map is of this site and that its tags were not moved since",
                    fit->left_out.size(), fit->left_out.size() + fit->map_tags.size()));
  }
  fit->solved = true;
}

bool Fitter::LeaveOutMoved(const std::vector<int>& run_of_image, std::vector<TagInRun>* moved) {
  double worst = kCornerChi2;
  TagInRun which;
  size_t begin = 0, end = 0;  // its factors
  size_t k = first_corner_;
  for (const WorldTag& tag : evidence_.tags) {
    std::map<int, std::vector<double>> errors;  // of each run
    std::map<int, std::pair<size_t, size_t>> range;
    for (const TagSighting& s : tag.sightings) {
      const int run = run_of_image[static_cast<size_t>(s.image)];
      range.try_emplace(run, k, k);
      for (int corner = 0; corner < 4; ++corner, ++k) {
        if (p_.factors[k].sqrt_info.isZero()) continue;  // left out
        errors[run].push_back(SquaredError(p_, p_.factors[k]));
      }
      range[run].second = k;
    }
    if (errors.size() < 2) continue;
    for (auto& [run, of_run] : errors) {
      const double median = Median(std::move(of_run));
      if (median > worst) worst = median, which = {run, tag.id}, begin = range[run].first, end = range[run].second;
    }
  }
  if (which.tag_id < 0) return false;
  for (size_t i = begin; i < end; ++i) p_.factors[i].sqrt_info.setZero();
  moved->push_back(which);
  return true;
}

// Noise of the corners from their residuals, never below what is stated.
void Fitter::WeighCorners() {
  constexpr size_t kLeast = 40;
  std::vector<double> errors;
  for (size_t i = first_corner_; i < first_corner_ + corners_; ++i) {
    if (!p_.factors[i].sqrt_info.isZero()) errors.push_back(SquaredError(p_, p_.factors[i]));
  }
  if (errors.size() < kLeast) return;
  const double factor = SigmaRatio(std::move(errors), 2);
  if (!(factor > 1)) return;
  for (size_t i = first_corner_; i < first_corner_ + corners_; ++i) p_.factors[i].sqrt_info /= factor;
}

bool Fitter::LeaveOutWorst(WorldFit* fit) {
  constexpr size_t kLeast = 2;  // if two contradict each other, the wrong one is unknown
  if (in_map_.size() <= kLeast) return false;
  // Residuals v of the map's tags with their cofactors (Baarda 1968): e = map - adjusted, Qvv = C - A Q A'. A fault of
  // one tag: T = (P v)' (P Qvv P)^-1 (P v), its six rows each.
  std::vector<int> poses = p_.map->rigs;
  if (frame_ >= 0) poses.push_back(frame_);
  const Eigen::MatrixXd q = BundleCovariance(p_, bundle_.threads, cancel_).Joint(poses);
  const MapTerms t = EvaluateMap(p_, *p_.map);  // whitened: C is the unit matrix
  const Eigen::MatrixXd qvv = Eigen::MatrixXd::Identity(t.r.size(), t.r.size()) - t.j * q * t.j.transpose();
  const Eigen::MatrixXd& l = p_.map->sqrt_info;
  const Eigen::VectorXd pv = l.transpose() * t.r;
  const Eigen::MatrixXd pqp = l.transpose() * qvv * l;
  double worst = 0;
  size_t which = 0;
  for (size_t i = 0; i < in_map_.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    const Vector6d own = pv.segment<6>(at);
    const double chi2 = own.dot(pqp.block<6, 6>(at, at).ldlt().solve(own));
    if (chi2 > worst) worst = chi2, which = i;
  }
  if (!(worst > kMovedChi2)) return false;
  const int id = evidence_.tags[in_map_[which]].id;
  fit->left_out.push_back(id);
  fit->warnings.push_back(
      fmt::format("tag {} is at another place in this run's images than in the map (chi-square {:.0f} with 6 degrees "
                  "of freedom, limit {:.0f}): its pose in the map is not used for this run. Was the tag moved?",
                  id, worst, kMovedChi2));
  in_map_.erase(in_map_.begin() + static_cast<std::ptrdiff_t>(which));
  SetMap();
  return true;
}

}  // namespace

GeoObservation GeoObservationOf(const GeoTag& tag, const LocalFrame& frame, const Rigid3d& odom_from_rig) {
  GeoObservation o;
  o.odom_from_rig = odom_from_rig;
  o.has_position = tag.has_position;
  if (tag.has_position) o.position = frame.EnuFromGeodetic(tag.position);
  if (!tag.has_height) o.position.z() = 0;
  o.has_height = tag.has_height;
  o.has_heading = tag.has_heading;
  o.has_tilt = tag.has_tilt;
  o.attitude = tag.attitude;
  o.sigma_h_m = tag.sigma_h_m, o.sigma_v_m = tag.sigma_v_m;
  o.sigma_heading_rad = tag.sigma_heading_rad, o.sigma_tilt_rad = tag.sigma_tilt_rad;
  return o;
}

GeoStart GeotagsOf(const LocalizeInput& input, const std::vector<int>& pose_of, const BundleProblem& problem) {
  GeoStart start;
  std::set<int> sets;  // whose geotag is counted
  for (size_t i = 0; i < pose_of.size(); ++i) {
    const ReferenceViews& reference = input.references[i];
    const GeoTag& tag = reference.geotag;
    const int pose = pose_of[i];
    if (pose < 0 || (!tag.has_position && !tag.has_heading)) continue;
    if (reference.set >= 0 && !sets.insert(reference.set).second) continue;
    start.observations.push_back(
        GeoObservationOf(tag, input.frame, problem.poses[static_cast<size_t>(pose)].Inverse()));
    start.observations.back().source = reference.source;
    start.poses.push_back(pose);
    start.references.push_back(static_cast<int>(i));
  }
  return start;
}

bool IsOutlier(const GeoObservation& o, const Eigen::Vector3d& off, const GeoRegistrationOptions& options) {
  const double v = o.has_height ? off.z() / o.sigma_v_m : 0;
  return off.head<2>().squaredNorm() / (o.sigma_h_m * o.sigma_h_m) + v * v > options.outlier_chi2;
}

std::string SourceOf(const WorldFit& fit) {
  std::vector<std::string> sources;
  if (fit.geotags) sources.emplace_back("geotags");
  if (fit.gps) sources.emplace_back("gps");
  if (!fit.map_tags.empty()) sources.emplace_back("tags");
  if (!fit.control_tags.empty()) sources.emplace_back("control");
  std::string text;
  for (size_t i = 0; i < sources.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == sources.size() ? " and " : ", ") + sources[i];
  }
  return text;
}

std::vector<Anchor> AnchorsOf(const LocalizeInput& input, const std::vector<WorldTag>& tags, const BundleProblem& p) {
  std::vector<Anchor> anchors;
  for (const WorldTag& tag : tags) {
    const int pose = input.images[static_cast<size_t>(tag.sightings.front().image)].pose;
    const Rigid3d odom_from_tag = p.poses[static_cast<size_t>(pose)].Inverse() * tag.body_from_tag;
    Anchor anchor;
    const auto add = [&](const Eigen::Vector3d& in_tag, const Eigen::Vector3d& world) {
      anchor.odom.push_back(odom_from_tag * in_tag);
      anchor.world.push_back(world);
    };
    for (const Eigen::Vector3d& corner : tag.corners) {
      if (tag.world_from_tag) add(corner, *tag.world_from_tag * corner);
    }
    for (const TagControl& control : tag.control) {
      if (!tag.world_from_tag) add(control.in_tag, control.position);
    }
    if (!anchor.odom.empty()) anchors.push_back(std::move(anchor));
  }
  return anchors;
}

double AnchorDistance(const Anchor& anchor, const Rigid3d& world_from_odom) {
  double sum = 0;
  for (size_t k = 0; k < anchor.odom.size(); ++k) sum += (world_from_odom * anchor.odom[k] - anchor.world[k]).norm();
  return sum / static_cast<double>(anchor.odom.size());
}

std::optional<Rigid3d> PoseOfAnchors(const std::vector<Anchor>& anchors, const std::optional<Rigid3d>& known,
                                     std::string* reason) {
  constexpr size_t kMostTried = 40;
  std::vector<Rigid3d> tried;
  if (known) tried.push_back(*known);
  const auto add = [&](const std::vector<const Anchor*>& of) {
    if (const auto pose = Align(of)) tried.push_back(*pose);
  };
  const size_t n = std::min(anchors.size(), kMostTried);
  for (size_t a = 0; a < n; ++a) {
    if (anchors[a].odom.size() >= 4) add({&anchors[a]});
    for (size_t b = 0; b < a; ++b) add({&anchors[a], &anchors[b]});
    if (a >= 2) add({&anchors[a], &anchors[a - 1], &anchors[0]});
  }
  std::optional<Rigid3d> best;
  double least = 0;
  for (const Rigid3d& pose : tried) {
    double cost = 0;
    for (const Anchor& anchor : anchors) {
      cost += std::min(std::pow(AnchorDistance(anchor, pose) / kAnchorNear_m, 2), 1.0);
    }
    if (!best || cost < least) best = pose, least = cost;
  }
  if (!best) {
    *reason = "too few common tags, points or panoramas to determine its pose";
    return best;
  }
  std::vector<const Anchor*> near;
  for (const Anchor& anchor : anchors) {
    if (AnchorDistance(anchor, *best) < kAnchorNear_m) near.push_back(&anchor);
  }
  if (2 * near.size() < anchors.size()) {
    *reason = fmt::format("only {} of {} tags, points and panoramas fit within {} m of one pose of the run",
                          near.size(), anchors.size(), kAnchorNear_m);
    return std::nullopt;
  }
  if (near.size() >= 3) {
    if (const auto refined = Align(near)) best = refined;
  }
  return best;
}

WorldFit FitWorld(const LocalizeInput& input, const GeoStart& start, const std::vector<GpsPlace>& gps,
                  const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
                  BundleProblem* problem, BundleSummary* summary, ProgressSink& progress, const CancelToken& cancel) {
  WorldFit fit;
  const std::vector<Anchor> anchors = AnchorsOf(input, evidence.tags, *problem);
  std::optional<Rigid3d> known;
  if (start.registration.solved) {
    const Sim3d& s = start.registration.world_from_odom;
    known = Rigid3d(s.rotation, s.translation);
  }
  const auto world = PoseOfAnchors(anchors, known, &fit.reason);
  if (!world) {
    fit.reason = anchors.empty() ? start.registration.reason
                 : fit.reason.find(" fit within ") == std::string::npos
                     ? fit.reason
                     : "the run's images and the surveyed tags contradict each other: " + fit.reason +
                           "; check the map, the tags' sizes and the odometry";
    return fit;
  }
  Fitter fitter(input, evidence, options, bundle, problem, progress, cancel);
  fitter.AddFrame(*world, &fit);
  fitter.AddTags(&fit);
  fitter.AddGeotags(start, &fit);
  // Where GPS is what the run would be georeferenced by, every fix takes part.
  const bool by_gps = std::any_of(start.references.begin(), start.references.end(), [](int r) { return r < 0; });
  if (evidence.gps || by_gps) fitter.AddGps(gps, 1, &fit);
  fitter.Solve();
  fitter.SolveWithMap(&fit, summary);
  return fit;
}

WorldFit FitSite(const LocalizeInput& input, const GeoStart& start, const SiteFitInput& site,
                 const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
                 BundleProblem* problem, BundleSummary* summary, std::vector<TagInRun>* moved, ProgressSink& progress,
                 const CancelToken& cancel) {
  WorldFit fit;
  Fitter fitter(input, evidence, options, bundle, problem, progress, cancel);
  fitter.AddTags(&fit);
  fitter.AddGeotags(start, &fit);
  const auto runs = std::count_if(site.gps.begin(), site.gps.end(), [](const auto& gps) { return !gps.empty(); });
  for (const std::vector<GpsPlace>& gps : site.gps) fitter.AddGps(gps, static_cast<int>(runs), &fit);
  fitter.SolveFromFarOff(site.links);
  site.after_links();
  fitter.Solve();
  while (fitter.LeaveOutMoved(site.run_of_image, moved)) fitter.Solve();
  fitter.SolveWithMap(&fit, summary);
  return fit;
}

GeoRegistration GeoRegistrationOf(const WorldFit& fit, const GeoStart& start, const GeoRegistrationOptions& options,
                                  const BundleProblem& p, const BundleCovariance& covariance, Eigen::MatrixXd* with_fit,
                                  double* scale_sigma) {
  GeoRegistration geo = start.registration;
  geo.solved = true;
  geo.reason.clear();
  const Rigid3d& frame = p.poses[static_cast<size_t>(fit.frame)];
  geo.world_from_odom = Sim3d{1, frame.rotation, frame.translation};
  const auto poses = static_cast<Eigen::Index>(p.poses.size());
  Eigen::MatrixXd of_frame = Eigen::MatrixXd::Zero(6 * poses, 7);
  of_frame.block<6, 6>(6 * fit.frame, 0).setIdentity();
  *with_fit = covariance.Times(of_frame);
  geo.covariance = Eigen::Matrix<double, 7, 7>::Zero();
  const Matrix6d own = with_fit->block<6, 6>(6 * fit.frame, 0);
  geo.covariance.topLeftCorner<6, 6>() = 0.5 * (own + own.transpose());
  for (Eigen::Index i = 0; i < poses; ++i) {
    with_fit->middleRows<6>(6 * i) =
        (InverseJacobian(p.poses[static_cast<size_t>(i)]) * with_fit->middleRows<6>(6 * i)).eval();
  }
  *scale_sigma = std::sqrt(covariance.ScaleVariance());
  for (size_t i = 0; i < start.observations.size(); ++i) {
    const GeoObservation& o = start.observations[i];
    if (start.references[i] < 0 || !o.has_position) continue;
    const Rigid3d& rig = p.poses[static_cast<size_t>(start.poses[i])];
    Eigen::Vector3d off = o.position - frame * rig.TargetOriginInSource();
    if (!o.has_height) off.z() = 0;
    geo.residuals[i] = off;
    geo.outlier[i] = IsOutlier(o, off, options);
  }
  return geo;
}

}  // namespace trigpoint
