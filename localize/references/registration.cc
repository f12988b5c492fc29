#include "localize/references/registration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "calib/base/parallel.h"
#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "calib/estimation/ransac.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/minimal_solvers.h"
#include "localize/reconstruct/two_view.h"
#include "localize/references/chance_match.h"
#include "localize/references/determined.h"
#include "localize/references/match_noise.h"

namespace trigpoint {
namespace {

// Traversals of the run that a reference is looked for in, at most.
constexpr size_t kTraversals = 3;

// One matched point: where a view sees it and which point it may be.
struct Correspondence {
  ViewObservation observation;
  Eigen::Vector3d ray;  // view frame
  // Turns an error of the ray into pixels of the view. Zero until Whiten sets it.
  Eigen::Matrix<double, 2, 3> whitening = Eigen::Matrix<double, 2, 3>::Zero();
  double descriptor_distance = 0;  // of unit descriptors
};

// A view's features, ready.
struct PreparedView {
  FeatureSet features;
  DescriptorBlock descriptors;
  std::unique_ptr<FeatureGrid> grid;
};

// An image's features, ready.
struct PreparedImage {
  FeatureSet features;
  DescriptorBlock descriptors;
};

// Features of an image that carry believed points.
struct ImagePoint {
  int feature;
  int point;
};

using ImagePoints = std::vector<std::vector<ImagePoint>>;

ImagePoints PointsOfImages(const LocalizeInput& input, const Reconstruction& r) {
  ImagePoints points(input.images.size());
  for (size_t k = 0; k < r.problem.observations.size(); ++k) {
    const BearingObservation& o = r.problem.observations[k];
    if (r.image_of[k] >= 0 && o.active && r.point_valid[static_cast<size_t>(o.point)]) {
      points[static_cast<size_t>(r.image_of[k])].push_back({r.feature_of[k], o.point});
    }
  }
  return points;
}

bool IsCentral(const ViewRig& rig) {
  for (const View& v : rig.views) {
    if ((v.rig_from_view.translation - rig.views[0].rig_from_view.translation).norm() > 1e-9) return false;
  }
  return true;
}

// Chord between the predicted and the observed ray: the angle, to third order.
double AngularError(const Rigid3d& view_from_rig, const Rigid3d& rig_from_odom, const Eigen::Vector3d& ray,
                    const Eigen::Vector3d& point) {
  return ((view_from_rig * (rig_from_odom * point)).normalized() - ray).norm();
}

// Whether a point looks the same from two centres: SIFT stands about 40 deg of change of viewpoint and a factor of 2.5
// in distance.
bool LooksAlike(const Eigen::Vector3d& from_pano, const Eigen::Vector3d& from_cam) {
  const double d_pano = from_pano.norm(), d_cam = from_cam.norm();
  if (d_pano < 0.3 || from_pano.dot(from_cam) < 0.77 * d_pano * d_cam) return false;
  return !(d_pano > 2.5 * d_cam || d_cam > 2.5 * d_pano);
}

// The view's features within a radius whose scale is about the one given.
void FindNearby(const PreparedView& view, const Eigen::Vector2d& pixel, double radius, float scale,
                std::vector<int>* nearby) {
  nearby->clear();
  view.grid->Visit(pixel.x(), pixel.y(), radius, [&](int j, const Eigen::Vector2f& at) {
    const float s = view.features.scales[static_cast<size_t>(j)];
    if (s > 2.0F * scale || scale > 2.0F * s) return;
    if ((at.cast<double>() - pixel).squaredNorm() > radius * radius) return;
    nearby->push_back(j);
  });
}

// The best match of a point in a view.
struct PointMatch {
  int distance = std::numeric_limits<int>::max();
  Correspondence c;
};
using PointMatches = std::map<std::pair<int, int>, PointMatch>;  // (view, point)

// A point in the overlap of two views of one centre is one observation, not two: that nearest to its view's axis.
void MarkRepeated(std::vector<Correspondence>* inliers) {
  std::map<int, Correspondence*> best;  // of each point
  for (Correspondence& c : *inliers) {
    const auto [it, fresh] = best.try_emplace(c.observation.point, &c);
    if (fresh) continue;
    Correspondence* repeated = &c;
    if (c.ray.z() > it->second->ray.z()) std::swap(it->second, repeated);
    repeated->observation.repeated = true;
  }
}

// A feature shows one point: of those it was matched with, the closest.
std::vector<Correspondence> OnePointEach(const PointMatches& of_point) {
  std::map<std::pair<int, int>, std::pair<int, int>> of_feature;  // (view, feature) -> (distance, point)
  for (const auto& [key, best] : of_point) {
    auto [it, fresh] = of_feature.try_emplace({key.first, best.c.observation.feature}, best.distance, key.second);
    if (!fresh && best.distance < it->second.first) it->second = {best.distance, key.second};
  }
  std::vector<Correspondence> out;
  for (const auto& [key, best] : of_point) {
    if (of_feature.at({key.first, best.c.observation.feature}).second == key.second) out.push_back(best.c);
  }
  return out;
}

class Registrar {
 public:
  Registrar(const LocalizeInput& input, const Reconstruction& reconstruction, const Retrieval& retrieval,
            const RegistrationOptions& options, bool paper, uint64_t seed, const CancelToken& cancel)
      : input_(input),
        r_(reconstruction),
        retrieval_(retrieval),
        o_(options),
        paper_(paper),
        seed_(seed),
        cancel_(cancel),
        sparse_(options.candidates * MedianStep(input) > options.passage_m),
        image_points_(PointsOfImages(input, reconstruction)),
        point_covariances_(PointCovariances(reconstruction.problem)) {
    for (const FrameImage& image : input.images) {
      const Rigid3d cam_from_odom = input.cameras[static_cast<size_t>(image.camera)].cam_from_body *
                                    r_.problem.poses[static_cast<size_t>(image.pose)];
      cam_from_odom_.push_back(cam_from_odom);
      centres_.push_back(cam_from_odom.TargetOriginInSource());
    }
    travelled_ = PathToImages(input, r_.problem.poses);
    std::array<std::vector<double>, 2> scores;
    for (const auto& hits : retrieval.of_image) {
      for (const Retrieval::Hit& h : hits) {
        scores[OfSet(input.references[static_cast<size_t>(h.reference)]) ? 1 : 0].push_back(h.score);
      }
    }
    for (size_t kind = 0; kind < 2; ++kind) typical_[kind] = Median(std::move(scores[kind]));
  }

  Registration Run(int reference) const {
    Job job{
        input_.references[static_cast<size_t>(reference)], reference, {}, {}, std::numeric_limits<double>::infinity(),
        seed_ + static_cast<uint64_t>(reference)};
    const int n_views = static_cast<int>(job.ref.rig.views.size());
    Registration out;
    out.views.resize(job.ref.rig.views.size());
    const std::vector<Traversal> traversals = Traversals(reference);
    if (traversals.empty()) {
      const bool tested = retrieval_.tested.empty() || retrieval_.tested[static_cast<size_t>(reference)] != 0;
      out.reason = tested ? "no image of the run looks like it"
                          : "not tested, as the run is elsewhere by its GPS or by what its images look like";
      return Unmatched(out);
    }
    for (int v = 0; v < n_views; ++v) Prepare(input_.view_features(reference, v), v, &job);
    for (size_t k = 0; k < traversals.size(); ++k) {
      if (traversals[k].last && out.status == AnswerStatus::kLocalized) break;
      job.candidates.clear();
      job.images.clear();
      job.path_m = traversals[k].length_m;
      for (int image : traversals[k].images) {
        // The views that the retrieval named, and their neighbours.
        std::set<int> chosen;
        for (const Retrieval::Hit& h : retrieval_.of_image[static_cast<size_t>(image)]) {
          if (h.reference != reference) continue;
          for (int d = -1; d <= 1; ++d) chosen.insert((h.view + d + n_views) % n_views);
        }
        job.candidates.push_back({image, {chosen.begin(), chosen.end()}});
      }
      Registration found;
      found.views.resize(job.ref.rig.views.size());
      found = paper_ ? RunPaper(job, std::move(found)) : RunJoint(job, std::move(found));
      if (k == 0) {
        out = std::move(found);
      } else {
        out = Stronger(std::move(out), std::move(found));
      }
    }
    return out;
  }

  // An image of the run itself against the points of an earlier traversal.
  Registration Run(const LoopQuery& query) const {
    const BodyCamera& camera =
        input_.cameras[static_cast<size_t>(input_.images[static_cast<size_t>(query.image)].camera)];
    ReferenceViews ref;
    ref.rig.views.resize(1);
    ref.rig.views[0].camera = camera.camera;
    Job job{ref, -1, {}, {}, query.latest_m, seed_ + 100003 * static_cast<uint64_t>(query.image + 1)};
    job.path_m = o_.passage_m;
    for (int image : query.candidates) job.candidates.push_back({image, {0}});
    Registration out;
    out.views.resize(1);
    Prepare(input_.image_features(query.image), 0, &job);
    return RunJoint(job, std::move(out));
  }

 private:
  // Points that support a second hypothesis. Its pose must also find a good share of what it predicts: a facade that
  // stands twice brings many points to a wrong pose, but not a good share.
  static double SecondSupport(const Registration& best, const Registration& other) {
    const double share = best.matched_share > 0 ? std::min(1.0, other.matched_share / best.matched_share) : 1.0;
    return std::min(other.support, share * best.support);
  }

  // Of the answers of two traversals, the one whose prediction finds more points; the other is the second hypothesis.
  Registration Stronger(Registration a, Registration b) const {
    const bool both = a.status == AnswerStatus::kLocalized && b.status == AnswerStatus::kLocalized;
    const bool second = both ? b.support > a.support : b.status == AnswerStatus::kLocalized;
    if (second) std::swap(a, b);
    const double apart = (a.rig_from_odom.TargetOriginInSource() - b.rig_from_odom.TargetOriginInSource()).norm();
    const double support = SecondSupport(a, b);
    if (a.status == AnswerStatus::kLocalized && apart > 1 && support > o_.rival_support_share * a.support) {
      char text[200];
      std::snprintf(
          text, sizeof text,
          "ambiguous: another traversal of the run puts it %.1f m away, where %.0f points are found, against %.0f",
          apart, support, a.support);
      a.status = AnswerStatus::kRejected;
      a.reason = text;
    }
    return a;
  }

  // What is to be placed, and the images it may be seen from.
  struct Candidate {
    int image;
    std::vector<int> views;  // matched with it
  };
  struct Job {
    const ReferenceViews& ref;
    int reference;  // -1: none of the input's
    std::vector<PreparedView> views;
    std::vector<Candidate> candidates;
    double latest_m;  // points of images after this length of path are not used
    uint64_t seed;
    // Images of this traversal, read once: matching, and the searches about both hypotheses, ask for the same ones.
    mutable std::map<int, PreparedImage> images = {};
    double path_m = 0;  // path about the candidates whose images' points are searched for
  };

  const PreparedImage& Image(const Job& job, int image) const {
    const auto [it, fresh] = job.images.try_emplace(image);
    if (fresh) {
      it->second.features = input_.image_features(image);
      it->second.descriptors = DescriptorBlock(it->second.features.descriptors);
    }
    return it->second;
  }

  void Prepare(FeatureSet features, int v, Job* job) const {
    PreparedView view;
    view.features = std::move(features);
    if (!paper_) view.descriptors = DescriptorBlock(view.features.descriptors);
    const Camera& c = job->ref.rig.views[static_cast<size_t>(v)].camera;
    view.grid = std::make_unique<FeatureGrid>(view.features.points, c.width(), c.height(), 16.0F);
    job->views.push_back(std::move(view));
  }

  static Registration Unmatched(Registration out) {
    out.status = AnswerStatus::kUnmatched;
    for (ViewAnswer& v : out.views) {
      if (v.reason.empty()) v.reason = out.reason;
    }
    return out;
  }

  struct Traversal {
    std::vector<int> images;
    double length_m;
    bool last;  // where none before it has an answer
  };

  // Images that retrieved a view of this reference, best first, spaced; those of the likeliest traversal first.
  // Structure repeats, so two traversals are tested. Where stops are so sparse that a traversal has few of them, the
  // last is the whole run.
  std::vector<Traversal> Traversals(int reference) const {
    std::vector<std::pair<float, int>> scored;
    for (size_t i = 0; i < retrieval_.of_image.size(); ++i) {
      float best = 0;
      for (const Retrieval::Hit& h : retrieval_.of_image[i]) {
        if (h.reference == reference) best = std::max(best, h.score);
      }
      if (best > 0 && !image_points_[i].empty()) scored.emplace_back(-best, static_cast<int>(i));
    }
    std::sort(scored.begin(), scored.end());
    std::vector<Traversal> traversals;
    if (paper_) {
      if (!scored.empty()) traversals.push_back({Spaced(scored, 4 * o_.candidates, 0), o_.passage_m, false});
      return traversals;
    }
    const std::vector<int> of_whole_run = Spaced(scored, o_.candidates, o_.candidate_spacing);
    // One traversal at a time: a run that comes by twice has drifted in between, and a pose fitted to both traversals
    // at once fits neither. The stretch of path with the most votes is taken first. Most of what is listed is listed by
    // chance: a score counts by how far it stands out, or the stretch with the most images would win.
    const double typical = typical_[OfSet(input_.references[static_cast<size_t>(reference)]) ? 1 : 0];
    while (!scored.empty() && traversals.size() < kTraversals - (sparse_ ? 1 : 0)) {
      double best_sum = -1, begin = 0;
      for (const auto& [score, image] : scored) {
        const double from = travelled_[static_cast<size_t>(image)];
        double sum = 0;
        for (const auto& [other_score, other] : scored) {
          const double at = travelled_[static_cast<size_t>(other)];
          const double above = std::max(0.0, -other_score - typical);
          if (at >= from && at <= from + o_.passage_m) sum += above * above;
        }
        if (sum > best_sum) best_sum = sum, begin = from;
      }
      const auto elsewhere = std::stable_partition(scored.begin(), scored.end(), [&](const auto& s) {
        const double at = travelled_[static_cast<size_t>(s.second)];
        return at >= begin && at <= begin + o_.passage_m;
      });
      traversals.push_back({Spaced({scored.begin(), elsewhere}, o_.candidates, o_.candidate_spacing), o_.passage_m,
                            traversals.size() + 1 == kTraversals});
      scored.erase(scored.begin(), elsewhere);
    }
    if (sparse_ && !of_whole_run.empty())
      traversals.push_back({of_whole_run, std::numeric_limits<double>::infinity(), true});
    return traversals;
  }

  // Whether two images show nearly the same: of one camera, close to each other in the run and in space. The other
  // cameras of a rig look elsewhere; stops farther apart than candidates spread evenly over a traversal all count.
  bool SameAs(int a, int b, int spacing) const {
    const FrameImage& of_a = input_.images[static_cast<size_t>(a)];
    const FrameImage& of_b = input_.images[static_cast<size_t>(b)];
    return of_a.camera == of_b.camera && std::abs(of_a.pose - of_b.pose) < spacing &&
           (centres_[static_cast<size_t>(a)] - centres_[static_cast<size_t>(b)]).norm() < o_.passage_m / o_.candidates;
  }

  std::vector<int> Spaced(const std::vector<std::pair<float, int>>& scored, int most, int spacing) const {
    std::vector<int> kept;
    for (const auto& [score, image] : scored) {
      const bool near = std::any_of(kept.begin(), kept.end(), [&, i = image](int k) { return SameAs(k, i, spacing); });
      if (!near) kept.push_back(image);
      if (static_cast<int>(kept.size()) >= most) break;
    }
    return kept;
  }

  std::vector<Rigid3d> ViewFromRig(const ViewRig& rig) const {
    std::vector<Rigid3d> out;
    for (const View& v : rig.views) out.push_back(v.rig_from_view.Inverse());
    return out;
  }

  double FocalOf(const ViewRig& rig) const { return rig.views.front().camera.MeanFocal(); }

  // --- ours ---------------------------------------------------------------------------------------------------

  Registration RunJoint(const Job& job, Registration out) const {
    const ReferenceViews& ref = job.ref;
    double middle = 0;
    for (const Candidate& c : job.candidates)
      middle += travelled_[static_cast<size_t>(c.image)] / static_cast<double>(job.candidates.size());
    std::vector<Correspondence> all = MatchCandidates(job);
    out.view_matches = static_cast<int>(all.size());
    const std::vector<Rigid3d> view_from_rig = ViewFromRig(ref.rig);
    if (static_cast<int>(all.size()) < o_.min_inliers / 2) {
      out.reason = all.empty() ? "no match with a point of the run"
                               : "only " + Counted(static_cast<int64_t>(all.size()), "match", "matches") +
                                     " with points of the run";
      return Unmatched(out);
    }
    const double threshold = o_.ransac_px / FocalOf(ref.rig);
    const auto best = FindPose(ref, all, view_from_rig, threshold, job.seed);
    if (!best.found || best.inliers.size() < 8) {
      out.reason = "no pose explains the matches (" + std::to_string(best.inliers.size()) + " of " +
                   std::to_string(all.size()) + " agree)";
      return Unmatched(out);
    }
    // The second hypothesis: the best pose of the matches that this one does not explain.
    std::vector<Correspondence> rest;
    {
      std::set<int> used(best.inliers.begin(), best.inliers.end());
      for (size_t i = 0; i < all.size(); ++i) {
        if (used.count(static_cast<int>(i)) == 0) rest.push_back(all[i]);
      }
    }
    out.agreeing = static_cast<int>(best.inliers.size());
    const auto refined = [&](const std::vector<Correspondence>& matches, const RansacResult<Rigid3d>& found) {
      std::vector<Correspondence> explained;
      for (int i : found.inliers) explained.push_back(matches[static_cast<size_t>(i)]);
      Whiten(ref, &explained);
      return RefinePose(view_from_rig, explained, found.model, o_.ransac_px / 3, "dcs", o_.outlier_chi2, nullptr);
    };
    Grow(job, view_from_rig, refined(all, best), middle, &out);
    const auto second = FindPose(ref, rest, view_from_rig, threshold, job.seed + 7777);
    if (second.found && second.inliers.size() >= 8) {
      // It counts only where it stays apart from the first pose.
      Registration other = out;
      Grow(job, view_from_rig, refined(rest, second), middle, &other);
      const double apart =
          (out.rig_from_odom.TargetOriginInSource() - other.rig_from_odom.TargetOriginInSource()).norm();
      if (apart > 1.0 || AngleBetween(out.rig_from_odom.rotation, other.rig_from_odom.rotation) > 5 * kDegToRad) {
        out.rival = static_cast<int>(second.inliers.size());
        out.rival_distance_m = apart;
        out.rival_support = SecondSupport(out, other);
      }
    }
    Decide(&out);
    if (out.status == AnswerStatus::kLocalized && ref.kind == ReferenceKind::kPanorama && !ref.stitched)
      out.stretch = StretchOf(ref, all, best.inliers, threshold, job.seed);
    AnswerViews(ref, view_from_rig, &out);
    return out;
  }

  std::vector<Correspondence> MatchCandidates(const Job& job) const {
    std::vector<Correspondence> all;
    std::set<std::tuple<int, int, int>> seen;
    std::map<int, int> times;  // a point is matched from at most two images: further ones are no independent evidence
    for (const auto& [image, chosen] : job.candidates) {
      cancel_.ThrowIfCancelled();
      const DescriptorBlock& full = Image(job, image).descriptors;
      DescriptorBlock block;
      std::vector<ImagePoint> points;
      for (const ImagePoint& p : image_points_[static_cast<size_t>(image)]) {
        if (++times[p.point] <= 2) points.push_back(p);
      }
      for (const ImagePoint& p : points) block.Append(full, p.feature);
      for (int v : chosen) {
        const PreparedView& view = job.views[static_cast<size_t>(v)];
        for (const auto& [i, j] : MatchMutual(block, view.descriptors, o_.ratio, o_.max_distance)) {
          Correspondence c;
          c.observation = {
              v, j, points[static_cast<size_t>(i)].point, image, view.features.points[static_cast<size_t>(j)], false};
          if (!seen.insert({v, j, c.observation.point}).second) continue;
          const auto ray =
              job.ref.rig.views[static_cast<size_t>(v)].camera.Unproject(c.observation.pixel.cast<double>());
          if (!ray) continue;
          c.ray = *ray;
          all.push_back(c);
        }
      }
    }
    return all;
  }

  StretchVotes StretchOf(const ReferenceViews& ref, const std::vector<Correspondence>& all,
                         const std::vector<int>& agreeing, double threshold, uint64_t seed) const {
    constexpr size_t kMost = 300;  // matches: more show a stretch no better, but take time
    const size_t step = (all.size() + kMost - 1) / kMost;
    std::vector<Eigen::Vector3d> rays, points;
    for (size_t i = 0; i < all.size(); i += step) {
      rays.push_back(ref.rig.views[static_cast<size_t>(all[i].observation.view)].rig_from_view.rotation * all[i].ray);
      points.push_back(r_.problem.points[static_cast<size_t>(all[i].observation.point)]);
    }
    StretchVotes votes{0, VoteForStretch(rays, points, threshold, seed)};
    for (const int i : agreeing) votes.as_it_is += static_cast<size_t>(i) % step == 0 ? 1 : 0;
    return votes;
  }

  RansacResult<Rigid3d> FindPose(const ReferenceViews& ref, const std::vector<Correspondence>& all,
                                 const std::vector<Rigid3d>& view_from_rig, double threshold, uint64_t seed) const {
    std::vector<Eigen::Vector3d> rays, rig_rays, points;
    std::vector<int> view_of;
    std::vector<Rigid3d> rig_from_view;
    for (const View& v : ref.rig.views) rig_from_view.push_back(v.rig_from_view);
    for (const Correspondence& c : all) {
      rays.push_back(c.ray);
      rig_rays.push_back(rig_from_view[static_cast<size_t>(c.observation.view)].rotation * c.ray);
      points.push_back(r_.problem.points[static_cast<size_t>(c.observation.point)]);
      view_of.push_back(c.observation.view);
    }
    RansacOptions ransac;
    ransac.max_iterations = o_.ransac_iterations;
    ransac.min_iterations = 200;
    ransac.threshold = threshold;
    ransac.seed = seed;
    const bool central = IsCentral(ref.rig);
    const Eigen::Vector3d centre = rig_from_view.front().translation;
    return Ransac<Rigid3d, 3>(
        static_cast<int>(all.size()), ransac,
        [&](const std::vector<int>& sample) {
          if (!central) return GeneralisedThreePointPoses(rays, view_of, rig_from_view, points, sample);
          std::vector<Rigid3d> poses = ThreePointPoses(rig_rays, points, sample);
          for (Rigid3d& p : poses) p.translation += centre;
          return poses;
        },
        [&](const Rigid3d& pose, int i) {
          const size_t k = static_cast<size_t>(i);
          if (central) return ((pose * points[k] - centre).normalized() - rig_rays[k]).norm();  // half the turns
          return AngularError(view_from_rig[static_cast<size_t>(view_of[k])], pose, rays[k], points[k]);
        });
  }

  double AngularErrorOf(const std::vector<Rigid3d>& view_from_rig, const Rigid3d& rig_from_odom,
                        const Correspondence& c) const {
    return AngularError(view_from_rig[static_cast<size_t>(c.observation.view)], rig_from_odom, c.ray,
                        r_.problem.points[static_cast<size_t>(c.observation.point)]);
  }

  void Whiten(const ReferenceViews& ref, std::vector<Correspondence>* matches) const {
    for (Correspondence& c : *matches) {
      const Camera& camera = ref.rig.views[static_cast<size_t>(c.observation.view)].camera;
      c.whitening = camera.BearingSqrtInfo(c.observation.pixel.cast<double>(), 1);
    }
  }

  // Pose alone, points held, matches by their weights.
  Rigid3d RefinePose(const std::vector<Rigid3d>& view_from_rig, const std::vector<Correspondence>& used,
                     const Rigid3d& start, double sigma_px, std::string_view loss, double chi2,
                     Matrix6d* covariance) const {
    BundleProblem p;
    p.points_constant = true;
    p.poses = {start};
    p.views = view_from_rig;
    p.loss = MakeLoss(loss, chi2);
    for (const Correspondence& c : used) {
      BearingObservation o;
      o.point = static_cast<int>(p.points.size());
      o.view = c.observation.view;
      o.ray = c.ray.cast<float>();
      o.w = (std::sqrt(c.observation.weight) / sigma_px * c.whitening).cast<float>();
      p.points.push_back(r_.problem.points[static_cast<size_t>(c.observation.point)]);
      p.observations.push_back(o);
    }
    BundleOptions bundle;
    bundle.threads = 1;
    bundle.max_iterations = 20;
    ProgressSink silent;
    try {
      SolveBundle(p, bundle, silent, cancel_);
      if (covariance != nullptr) *covariance = BundleCovariance(p, 1, cancel_).Joint({0});
    } catch (const NumericError&) {
      if (covariance != nullptr) *covariance = Matrix6d::Identity() * 1e6;
      return start;
    }
    return p.poses[0];
  }

  // Gives each match the probability that it is true, and the pose that follows, in turns. What chance finds near the
  // prediction agrees with the pose predicted from: with full weight it would hold the pose there.
  Rigid3d WeighMatches(const ReferenceViews& ref, const std::vector<Rigid3d>& view_from_rig, double radius_px,
                       Rigid3d pose, std::vector<Correspondence>* matches) const {
    constexpr int kRounds = 6;
    constexpr double kMostNoise = 3;
    std::vector<FoundMatch> kinds;
    for (const Correspondence& c : *matches) {
      const Eigen::Vector3d& y = r_.problem.points[static_cast<size_t>(c.observation.point)];
      kinds.push_back(
          {FocalOf(ref.rig) * AngularErrorOf(view_from_rig, pose, c), c.descriptor_distance, (pose * y).norm()});
    }
    const std::vector<double> shares = TrueShares(kinds, radius_px);
    double noise = 1;  // of a match, in sigma_px; at least as stated
    for (int round = 0; round < kRounds; ++round) {
      double squares = 0, weights = 0;
      for (size_t i = 0; i < matches->size(); ++i) {
        Correspondence& c = (*matches)[i];
        const auto point = static_cast<size_t>(c.observation.point);
        ObservationTerms t;
        c.observation.weight = 0;
        if (!EvaluateBearing<true>(pose, view_from_rig[static_cast<size_t>(c.observation.view)],
                                   c.whitening / o_.sigma_px, c.ray, r_.problem.points[point], &t)) {
          continue;
        }
        const Eigen::Matrix2d covariance =
            noise * noise * (Eigen::Matrix2d::Identity() + t.jy * point_covariances_[point] * t.jy.transpose());
        const double chi2 = t.r.dot(covariance.inverse() * t.r);
        c.observation.weight =
            TrueProbability(shares[i], chi2, std::sqrt(covariance.determinant()), radius_px / o_.sigma_px);
        squares += c.observation.weight * chi2;
        weights += c.observation.weight;
      }
      if (weights > 0) noise = std::clamp(noise * std::sqrt(squares / (2 * weights)), 1.0, kMostNoise);
      pose = RefinePose(view_from_rig, *matches, pose, o_.sigma_px, "none", 1, nullptr);
    }
    return pose;
  }

  // Matches that are more likely true than not; where these are too few to be choosy, also less likely ones, which
  // count by their weights.
  std::vector<Correspondence> LikelyMatches(const std::vector<Correspondence>& weighed) const {
    constexpr double kLikely = 0.5, kPossible = 0.1;
    const auto above = [&](double least) {
      std::vector<Correspondence> kept;
      for (const Correspondence& c : weighed) {
        if (c.observation.weight > least) kept.push_back(c);
      }
      return kept;
    };
    std::vector<Correspondence> likely = above(kLikely);
    return static_cast<int>(likely.size()) >= 2 * o_.min_inliers ? likely : above(kPossible);
  }

  // Chance matches fill the search circle evenly; true ones gather at its middle. What lies in the inner half of the
  // radius, less a third of what lies in the outer ring (a third of its area), is evidence.
  double SupportOf(const std::vector<Correspondence>& found, const ReferenceViews& ref,
                   const std::vector<Rigid3d>& view_from_rig, const Rigid3d& pose, double radius_px) const {
    int inner = 0, outer = 0;
    for (const Correspondence& c : found) {
      const double e = FocalOf(ref.rig) * AngularErrorOf(view_from_rig, pose, c);
      if (e < 0.5 * radius_px) {
        ++inner;
      } else if (e < radius_px) {
        ++outer;
      }
    }
    return inner - outer / 3.0;
  }

  // From a first pose: refine, look for every point that should be seen, refine again.
  void Grow(const Job& job, const std::vector<Rigid3d>& view_from_rig, const Rigid3d& start, double middle,
            Registration* out) const {
    const ReferenceViews& ref = job.ref;
    Rigid3d pose = start;
    std::vector<Correspondence> found;
    int expected = 0;
    double radius = o_.guided_px;
    for (int round = 0; round < 2; ++round) {
      radius = o_.guided_px / (round + 1);
      found = SearchPredicted(job, view_from_rig, pose, middle, radius, &expected);
      if (found.size() < 6) break;
      for (double sigma = std::max(o_.sigma_px, radius / 4);; sigma = std::max(o_.sigma_px, sigma / 2)) {
        pose = RefinePose(view_from_rig, found, pose, sigma, "tukey", o_.outlier_chi2, nullptr);
        if (sigma <= o_.sigma_px) break;
      }
    }
    out->support = SupportOf(found, ref, view_from_rig, pose, radius);
    pose = WeighMatches(ref, view_from_rig, radius, pose, &found);
    std::vector<Correspondence> inliers = LikelyMatches(found);
    if (IsCentral(ref.rig)) MarkRepeated(&inliers);
    std::vector<Correspondence> independent;
    for (const Correspondence& c : inliers) {
      if (!c.observation.repeated) independent.push_back(c);
    }
    out->inliers.clear();
    out->rig_from_odom = pose;
    if (independent.size() >= 6) {
      out->rig_from_odom =
          RefinePose(view_from_rig, independent, pose, o_.sigma_px, "dcs", o_.outlier_chi2, &out->covariance);
    } else {
      out->covariance = Matrix6d::Identity() * 1e6;
    }
    for (const Correspondence& c : inliers) out->inliers.push_back(c.observation);
    out->matched_share = expected > 0 ? std::max(0.0, out->support) / expected : 0;
  }

  // The images nearest to a place, spaced, in both directions of travel.
  std::vector<int> NearImages(const Job& job, const Eigen::Vector3d& centre, double middle) const {
    std::vector<std::pair<double, int>> near;
    for (size_t i = 0; i < centres_.size(); ++i) {
      if (image_points_[i].empty() || std::abs(travelled_[i] - middle) > job.path_m || travelled_[i] > job.latest_m)
        continue;
      near.emplace_back((centres_[i] - centre).norm(), static_cast<int>(i));
    }
    std::sort(near.begin(), near.end());
    std::vector<int> images;
    for (const auto& [distance, image] : near) {
      if (distance > o_.max_distance_m) break;
      const bool close = std::any_of(images.begin(), images.end(),
                                     [&, i = image](int k) { return SameAs(k, i, o_.candidate_spacing); });
      if (!close) images.push_back(image);
      if (static_cast<int>(images.size()) >= o_.guided_images) break;
    }
    return images;
  }

  // Points that the pose predicts to be seen, found by descriptor near their predicted place.
  std::vector<Correspondence> SearchPredicted(const Job& job, const std::vector<Rigid3d>& view_from_rig,
                                              const Rigid3d& rig_from_odom, double middle, double radius,
                                              int* expected) const {
    const std::vector<PreparedView>& views = job.views;
    const ReferenceViews& ref = job.ref;
    const Eigen::Vector3d centre = rig_from_odom.TargetOriginInSource();
    const std::vector<int> images = NearImages(job, centre, middle);
    PointMatches of_point;
    std::set<int> predicted;
    std::vector<int> nearby, distances;
    const int most = static_cast<int>(o_.max_distance * o_.max_distance * 255 * 255);
    for (int image : images) {
      cancel_.ThrowIfCancelled();
      const FeatureSet& features = Image(job, image).features;
      const DescriptorBlock& block = Image(job, image).descriptors;
      const Camera& camera =
          input_.cameras[static_cast<size_t>(input_.images[static_cast<size_t>(image)].camera)].camera;
      for (const ImagePoint& p : image_points_[static_cast<size_t>(image)]) {
        const Eigen::Vector3d& y = r_.problem.points[static_cast<size_t>(p.point)];
        const Eigen::Vector3d from_pano = y - centre, from_cam = y - centres_[static_cast<size_t>(image)];
        if (!LooksAlike(from_pano, from_cam)) continue;
        const double d_pano = from_pano.norm(), d_cam = from_cam.norm();
        const Eigen::Vector3d in_rig = rig_from_odom * y;
        for (size_t v = 0; v < views.size(); ++v) {
          const Camera& view_camera = ref.rig.views[v].camera;
          const auto pixel = view_camera.Project(view_from_rig[v] * in_rig);
          if (!pixel || !view_camera.Contains(*pixel)) continue;
          const float scale = features.scales[static_cast<size_t>(p.feature)] *
                              static_cast<float>(view_camera.MeanFocal() / camera.MeanFocal() * d_cam / d_pano);
          const PreparedView& view = views[v];
          FindNearby(view, *pixel, radius, scale, &nearby);
          // A point counts as expected where the view has texture of its scale.
          if (!nearby.empty()) predicted.insert(p.point);
          block.SquaredDistances(p.feature, view.descriptors, nearby, &distances);
          NearestTwo nearest;
          nearest.best = most;
          for (size_t k = 0; k < nearby.size(); ++k) nearest.Offer(distances[k], nearby[k]);
          if (nearest.index < 0 || nearest.best > 0.9 * 0.9 * nearest.second) continue;
          const Eigen::Vector2f& found = view.features.points[static_cast<size_t>(nearest.index)];
          const auto ray = view_camera.Unproject(found.cast<double>());
          if (!ray) continue;
          PointMatch& slot = of_point[{static_cast<int>(v), p.point}];
          if (nearest.best >= slot.distance) continue;
          slot.distance = nearest.best;
          slot.c.ray = *ray;
          slot.c.descriptor_distance = std::sqrt(static_cast<double>(nearest.best)) / 255;
          slot.c.observation = {static_cast<int>(v), nearest.index, p.point, image, found, false};
        }
      }
    }
    std::vector<Correspondence> out = OnePointEach(of_point);
    Whiten(ref, &out);
    *expected = static_cast<int>(predicted.size());
    return out;
  }

  double NearestCamera(const Eigen::Vector3d& centre) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& c : centres_) nearest = std::min(nearest, (c - centre).norm());
    return nearest;
  }

  void Decide(Registration* out) const {
    int independent = 0;
    for (const ViewObservation& o : out->inliers) independent += o.repeated ? 0 : 1;
    const Eigen::Vector3d centre = out->rig_from_odom.TargetOriginInSource();
    out->distance_m = NearestCamera(centre);
    const double sigma = LargestPositionSigma(out->rig_from_odom, out->covariance);
    char text[200];
    out->status = AnswerStatus::kRejected;
    if (independent < o_.min_inliers) {
      std::snprintf(text, sizeof text, "%d points of the run fit the best pose, %d needed", independent,
                    o_.min_inliers);
    } else if (out->support < o_.min_inliers) {
      std::snprintf(text, sizeof text, "%.0f points are found where the pose predicts them, beyond chance; %d needed",
                    std::max(0.0, out->support), o_.min_inliers);
    } else if (out->matched_share < o_.min_matched_share) {
      std::snprintf(text, sizeof text, "only %.1f %% of the points that should be seen are found (%.1f %% needed)",
                    100 * out->matched_share, 100 * o_.min_matched_share);
    } else if (out->rival > o_.rival_share * out->agreeing) {
      std::snprintf(text, sizeof text, "ambiguous: another pose, %.1f m away, explains %d matches against %d",
                    out->rival_distance_m, out->rival, out->agreeing);
    } else if (out->rival_support > o_.rival_support_share * out->support) {
      std::snprintf(text, sizeof text,
                    "ambiguous: another pose, %.1f m away, predicts %.0f points that are found, against %.0f",
                    out->rival_distance_m, out->rival_support, out->support);
    } else if (out->agreeing < o_.min_agreement * out->view_matches) {
      std::snprintf(text, sizeof text, "only %d of %d matches agree on a pose (%.0f %% needed)", out->agreeing,
                    out->view_matches, 100 * o_.min_agreement);
    } else if (out->distance_m > o_.max_distance_m) {
      std::snprintf(text, sizeof text, "%.1f m from the nearest camera, at most %.1f m", out->distance_m,
                    o_.max_distance_m);
    } else if (!(sigma <= o_.max_sigma_m)) {
      std::snprintf(text, sizeof text, "position sigma %.2f m, at most %.2f m", sigma, o_.max_sigma_m);
    } else {
      out->status = AnswerStatus::kLocalized;
      text[0] = 0;
    }
    out->reason = text;
  }

  // G1: each view from its own inliers.
  void AnswerViews(const ReferenceViews& ref, const std::vector<Rigid3d>& view_from_rig, Registration* out) const {
    for (size_t v = 0; v < ref.rig.views.size(); ++v) {
      std::vector<Correspondence> used;
      for (const ViewObservation& o : out->inliers) {
        if (o.view != static_cast<int>(v)) continue;
        Correspondence c;
        c.observation = o;
        c.ray = *ref.rig.views[v].camera.Unproject(o.pixel.cast<double>());
        used.push_back(c);
      }
      Whiten(ref, &used);
      ViewAnswer& answer = out->views[v];
      answer.inliers = static_cast<int>(used.size());
      if (used.size() < 8) {
        answer.status = used.empty() ? AnswerStatus::kUnmatched : AnswerStatus::kRejected;
        answer.reason = std::to_string(used.size()) + " points of the run fit the pose, 8 needed";
        continue;
      }
      const Rigid3d rig_from_odom =
          RefinePose(view_from_rig, used, out->rig_from_odom, o_.sigma_px, "dcs", o_.outlier_chi2, nullptr);
      answer.view_from_odom = view_from_rig[v] * rig_from_odom;
      answer.distance_m = NearestCamera(answer.view_from_odom.TargetOriginInSource());
      const bool near = answer.distance_m <= o_.max_distance_m;
      answer.status = near ? AnswerStatus::kLocalized : AnswerStatus::kRejected;
      if (!near) answer.reason = "too far from the nearest camera";
    }
  }

  // --- as published -------------------------------------------------------------------------------------------

  // What the images show of a view.
  struct SeenView {
    std::vector<Correspondence> matches;
    int best_image = -1;  // with the most matches
  };

  Registration RunPaper(const Job& job, Registration out) const {
    const std::vector<Rigid3d> view_from_rig = ViewFromRig(job.ref.rig);
    const std::vector<SeenView> seen = SeeViews(job);
    for (const SeenView& view : seen) out.view_matches += static_cast<int>(view.matches.size());
    std::vector<int> answered;
    for (int v = 0; v < static_cast<int>(seen.size()); ++v) {
      ViewAnswer& answer = out.views[static_cast<size_t>(v)];
      answer = LocateView(job.ref, view_from_rig, seen[static_cast<size_t>(v)], v, &out.inliers);
      if (answer.status == AnswerStatus::kLocalized) answered.push_back(v);
    }
    if (answered.empty()) {
      out.status = out.view_matches > 0 ? AnswerStatus::kRejected : AnswerStatus::kUnmatched;
      out.reason = out.view_matches > 0 ? "no view (G1) could be located by itself" : "no view matches";
      return out;
    }
    LocateConnected(job.ref, view_from_rig, seen, answered, &out);
    return out;
  }

  // An image with a view.
  struct ImageMatches {
    int image;
    std::vector<Correspondence> matches;  // all that the homography explains
  };

  std::vector<SeenView> SeeViews(const Job& job) const {
    std::vector<std::vector<ImageMatches>> seen_by(job.views.size());
    for (const Candidate& candidate : job.candidates) {
      cancel_.ThrowIfCancelled();
      const FeatureSet features = input_.image_features(candidate.image);
      std::map<int, int> point_of;
      for (const ImagePoint& p : image_points_[static_cast<size_t>(candidate.image)]) point_of[p.feature] = p.point;
      for (const Retrieval::Hit& h : retrieval_.of_image[static_cast<size_t>(candidate.image)]) {
        if (h.reference != job.reference) continue;
        auto matches = MatchByHomography(job, h.view, candidate.image, features, point_of);
        if (matches) seen_by[static_cast<size_t>(h.view)].push_back({candidate.image, std::move(*matches)});
      }
    }
    std::vector<SeenView> views;
    for (std::vector<ImageMatches>& images : seen_by) views.push_back(WithMostMatches(std::move(images)));
    return views;
  }

  // Matches of an image's points with a view; none where a homography explains too few of all matches.
  std::optional<std::vector<Correspondence>> MatchByHomography(const Job& job, int view, int image,
                                                               const FeatureSet& features,
                                                               const std::map<int, int>& point_of) const {
    const FeatureSet& of_view = job.views[static_cast<size_t>(view)].features;
    const Matches matches = MatchFlann(features.descriptors, of_view.descriptors, o_.ratio);
    std::vector<Eigen::Vector2f> pa, pb;
    for (const auto& [i, j] : matches) {
      pa.push_back(features.points[static_cast<size_t>(i)]);
      pb.push_back(of_view.points[static_cast<size_t>(j)]);
    }
    const std::vector<int> inliers = VerifyHomography(pa, pb, o_.homography_px);
    if (static_cast<int>(inliers.size()) < o_.homography_min_inliers) return {};
    std::vector<Correspondence> explained;
    for (int k : inliers) {
      const auto [i, j] = matches[static_cast<size_t>(k)];
      const auto it = point_of.find(i);
      const Eigen::Vector2f pixel = of_view.points[static_cast<size_t>(j)];
      const auto ray = job.ref.rig.views[static_cast<size_t>(view)].camera.Unproject(pixel.cast<double>());
      if (it == point_of.end() || !ray) continue;
      explained.push_back({{view, j, it->second, image, pixel, false}, *ray});
    }
    return explained;
  }

  // "To select the matching images from K" (the paper does not say how many): those with the most matches.
  SeenView WithMostMatches(std::vector<ImageMatches> images) const {
    std::stable_sort(images.begin(), images.end(),
                     [](const ImageMatches& x, const ImageMatches& y) { return x.matches.size() > y.matches.size(); });
    SeenView view;
    if (!images.empty()) view.best_image = images.front().image;
    std::set<std::pair<int, int>> known;  // (feature of the view, point)
    for (size_t k = 0; k < std::min(images.size(), static_cast<size_t>(o_.homography_images)); ++k) {
      for (const Correspondence& c : images[k].matches) {
        if (known.insert({c.observation.feature, c.observation.point}).second) view.matches.push_back(c);
      }
    }
    return view;
  }

  // G1: every view by itself. The start (the paper is silent): three-point RANSAC on the view's own matches.
  ViewAnswer LocateView(const ReferenceViews& ref, const std::vector<Rigid3d>& view_from_rig, const SeenView& seen,
                        int v, std::vector<ViewObservation>* inliers) const {
    ViewAnswer answer;
    if (seen.matches.size() < 6) {
      answer.reason = std::to_string(seen.matches.size()) + " matches with points, 6 needed";
      return answer;
    }
    const double threshold = o_.ransac_px / FocalOf(ref.rig);
    const auto start = FindPose(ref, seen.matches, view_from_rig, threshold, seed_ + 31 * static_cast<uint64_t>(v));
    answer.status = AnswerStatus::kRejected;
    if (!start.found || start.inliers.size() < 6) {
      answer.reason = "no pose explains the matches";
      return answer;
    }
    std::vector<Correspondence> matches = seen.matches;
    Whiten(ref, &matches);
    const Rigid3d rig = RefinePose(view_from_rig, matches, start.model, o_.sigma_px, "dcs", 1.0, nullptr);
    answer.view_from_odom = view_from_rig[static_cast<size_t>(v)] * rig;
    for (const Correspondence& c : matches) {
      if (AngularErrorOf(view_from_rig, rig, c) < threshold) {
        ++answer.inliers;
        inliers->push_back(c.observation);
      }
    }
    answer.distance_m = DistanceFrom(seen.best_image, answer.view_from_odom);
    answer.reason = TooFar(answer.distance_m);
    if (answer.reason.empty()) answer.status = AnswerStatus::kLocalized;
    return answer;
  }

  // "estimated too far with respect to the current pose": the camera that matched best. Empty: near enough.
  std::string TooFar(double distance_m) const {
    if (!(distance_m > o_.max_distance_m)) return "";
    return "estimated " + std::to_string(static_cast<int>(distance_m)) + " m from the current camera";
  }

  double DistanceFrom(int image, const Rigid3d& x_from_odom) const {
    return (x_from_odom.TargetOriginInSource() - centres_[static_cast<size_t>(image)]).norm();
  }

  // G2: the views' poses tied together (same position, known relative yaw). Its minimum is looked for from every
  // view's own answer: a view that has converged to a repeated facade is a bad start.
  void LocateConnected(const ReferenceViews& ref, const std::vector<Rigid3d>& view_from_rig,
                       const std::vector<SeenView>& seen, const std::vector<int>& answered, Registration* out) const {
    std::optional<Connected> best;
    size_t at = 0;  // whose answer was the start, of those answered
    for (size_t k = 0; k < answered.size(); ++k) {
      const auto v = static_cast<size_t>(answered[k]);
      const Rigid3d start = ref.rig.views[v].rig_from_view * out->views[v].view_from_odom;
      Connected connected = Connect(ref, view_from_rig, seen, answered, start);
      if (best && connected.cost >= best->cost) continue;
      best = std::move(connected);
      at = k;
    }
    const auto lead = static_cast<size_t>(answered[at]);
    out->rig_from_odom = ref.rig.views[lead].rig_from_view * best->problem.poses[at];
    try {
      out->covariance = BundleCovariance(best->problem, 1, cancel_).Joint({static_cast<int>(at)});
    } catch (const NumericError&) {
      out->covariance = Matrix6d::Identity() * 1e6;
    }
    out->distance_m = DistanceFrom(seen[lead].best_image, out->rig_from_odom);
    out->reason = TooFar(out->distance_m);
    out->status = out->reason.empty() ? AnswerStatus::kLocalized : AnswerStatus::kRejected;
  }

  struct Connected {
    BundleProblem problem;  // a pose for each answered view, view_from_odom
    double cost = 0;
  };
  Connected Connect(const ReferenceViews& ref, const std::vector<Rigid3d>& view_from_rig,
                    const std::vector<SeenView>& seen, const std::vector<int>& answered, const Rigid3d& start) const {
    BundleProblem p;
    p.points_constant = true;
    p.loss = MakeLoss("dcs", 1.0);
    p.views = {Rigid3d()};
    for (int v : answered) {
      const int pose = static_cast<int>(p.poses.size());
      p.poses.push_back(view_from_rig[static_cast<size_t>(v)] * start);
      if (pose > 0) {
        PoseFactor f;
        f.kind = PoseFactor::Kind::kBetween;
        f.a = pose - 1, f.b = pose;
        f.measured = view_from_rig[static_cast<size_t>(answered[static_cast<size_t>(pose - 1)])] *
                     ref.rig.views[static_cast<size_t>(v)].rig_from_view;
        // The paper gives no information matrix; 0.1 deg and 1 cm tie the views firmly without freezing the solver.
        f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / (0.1 * kDegToRad)), Eigen::Vector3d::Constant(1 / 0.01);
        p.factors.push_back(f);
      }
      for (const Correspondence& c : seen[static_cast<size_t>(v)].matches) {
        BearingObservation o;
        o.point = static_cast<int>(p.points.size());
        o.pose = pose;
        o.ray = c.ray.cast<float>();
        o.w = ref.rig.views[static_cast<size_t>(v)]
                  .camera.BearingSqrtInfo(c.observation.pixel.cast<double>(), o_.sigma_px)
                  .cast<float>();
        p.points.push_back(r_.problem.points[static_cast<size_t>(c.observation.point)]);
        p.observations.push_back(o);
      }
    }
    BundleOptions bundle;
    bundle.threads = 1;
    ProgressSink silent;
    const double cost = SolveBundle(p, bundle, silent, cancel_).final_cost;
    return {std::move(p), cost};
  }

  const LocalizeInput& input_;
  const Reconstruction& r_;
  const Retrieval& retrieval_;
  const RegistrationOptions& o_;
  bool paper_;
  uint64_t seed_;
  const CancelToken& cancel_;
  bool sparse_;  // stops are so far apart that a traversal has fewer of them than candidates are asked for
  ImagePoints image_points_;
  // By the run's rays: a point far along them says little about a reference that sees it from the side.
  std::vector<Eigen::Matrix3d> point_covariances_;
  std::vector<Rigid3d> cam_from_odom_;
  std::vector<Eigen::Vector3d> centres_;
  std::vector<double> travelled_;  // path length up to each image, m
  std::array<double, 2> typical_;  // median score of what is listed for the images: others, hand-held sets
};

}  // namespace

std::string_view AnswerStatusName(AnswerStatus status) {
  switch (status) {
    case AnswerStatus::kLocalized: return "localized";
    case AnswerStatus::kRejected: return "rejected";
    case AnswerStatus::kUnmatched: return "unmatched";
  }
  return "unmatched";
}

std::vector<Registration> RegisterReferences(const LocalizeInput& input, const Reconstruction& reconstruction,
                                             const Retrieval& retrieval, const RegistrationOptions& options, bool paper,
                                             int threads, uint64_t seed, ProgressSink& progress,
                                             const CancelToken& cancel, const std::vector<size_t>* some) {
  const Registrar registrar(input, reconstruction, retrieval, options, paper, seed, cancel);
  std::vector<Registration> result(some != nullptr ? some->size() : input.references.size());
  progress.Begin("references", static_cast<int64_t>(result.size()));
  ParallelFor(static_cast<int64_t>(result.size()), threads, cancel, [&](int64_t k) {
    const auto at = static_cast<size_t>(k);
    result[at] = registrar.Run(static_cast<int>(some != nullptr ? (*some)[at] : at));
    progress.Advance(1);
  });
  return result;
}

std::vector<Registration> RegisterImages(const LocalizeInput& input, const Reconstruction& reconstruction,
                                         const std::vector<LoopQuery>& queries, const RegistrationOptions& options,
                                         int threads, uint64_t seed, ProgressSink& progress,
                                         const CancelToken& cancel) {
  const Retrieval none;
  const Registrar registrar(input, reconstruction, none, options, false, seed, cancel);
  std::vector<Registration> result(queries.size());
  progress.Begin("loops", static_cast<int64_t>(result.size()));
  ParallelFor(static_cast<int64_t>(result.size()), threads, cancel, [&](int64_t i) {
    result[static_cast<size_t>(i)] = registrar.Run(queries[static_cast<size_t>(i)]);
    progress.Advance(1);
  });
  return result;
}

}  // namespace trigpoint
