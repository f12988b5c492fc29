#include "localize/reconstruct/loops.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "calib/base/memory.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"

namespace trigpoint {
namespace {

struct Loop {
  int image = 0;
  int anchor = 0;  // pose of the nearest image of the earlier traversal
  double anchor_travelled = 0;
  double travelled = 0;    // path up to the image, m
  Rigid3d body_from_odom;  // in the frame of the earlier traversal
  std::vector<ViewObservation> inliers;
};

class LoopFinder {
 public:
  LoopFinder(const LocalizeInput& input, const LoopOptions& options, const Reconstruction& r)
      : input_(input), o_(options), r_(r), travelled_(PathToImages(input, r.problem.poses)) {
    for (const FrameImage& image : input.images) {
      const Rigid3d cam_from_odom = CamFromBody(image) * r.problem.poses[static_cast<size_t>(image.pose)];
      centres_.push_back(cam_from_odom.TargetOriginInSource());
      axes_.push_back(cam_from_odom.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    }
  }

  std::vector<LoopQuery> Queries() const {
    std::vector<LoopQuery> queries;
    double last = -o_.spacing_m;
    for (size_t j = 0; j < centres_.size(); ++j) {
      if (travelled_[j] - last < o_.spacing_m) continue;
      std::vector<std::pair<double, int>> near;
      for (size_t i = 0; i < j; ++i) {
        const double path = travelled_[j] - travelled_[i];
        if (path < o_.gap_m) break;
        const double distance = (centres_[i] - centres_[j]).norm();
        if (distance < o_.radius_m + 3 * o_.drift_part * path &&
            AngleBetween(axes_[i], axes_[j]) < o_.angle_deg * kDegToRad) {
          near.emplace_back(distance, static_cast<int>(i));
        }
      }
      if (near.empty()) continue;
      std::sort(near.begin(), near.end());
      LoopQuery query;
      query.image = static_cast<int>(j);
      query.latest_m = travelled_[j] - 0.5 * o_.gap_m;
      for (const auto& [distance, i] : near) {
        const bool close = std::any_of(query.candidates.begin(), query.candidates.end(),
                                       [i = i](int k) { return std::abs(k - i) < 2; });
        if (!close) query.candidates.push_back(i);
        if (static_cast<int>(query.candidates.size()) >= o_.candidates) break;
      }
      queries.push_back(query);
      last = travelled_[j];
    }
    return queries;
  }

  Loop MakeLoop(const LoopQuery& query, const Registration& g) const {
    const FrameImage& image = input_.images[static_cast<size_t>(query.image)];
    Loop loop;
    loop.image = query.image;
    loop.anchor = input_.images[static_cast<size_t>(query.candidates.front())].pose;
    loop.anchor_travelled = travelled_[static_cast<size_t>(query.candidates.front())];
    loop.travelled = travelled_[static_cast<size_t>(query.image)];
    loop.body_from_odom = CamFromBody(image).Inverse() * g.rig_from_odom;
    loop.inliers = g.inliers;
    return loop;
  }

  const Rigid3d& Predicted(const Loop& loop) const {
    return r_.problem.poses[static_cast<size_t>(input_.images[static_cast<size_t>(loop.image)].pose)];
  }

  // Do two loops tell of the same drift? The drift that one has found, applied to the other.
  bool Agree(const Loop& a, const Loop& b) const {
    const Rigid3d by_a = Predicted(b) * Predicted(a).Inverse() * a.body_from_odom;
    return (by_a.TargetOriginInSource() - b.body_from_odom.TargetOriginInSource()).norm() < 0.3 &&
           AngleBetween(by_a.rotation, b.body_from_odom.rotation) < 1.5 * kDegToRad;
  }

 private:
  const Rigid3d& CamFromBody(const FrameImage& image) const {
    return input_.cameras[static_cast<size_t>(image.camera)].cam_from_body;
  }
  const LocalizeInput& input_;
  const LoopOptions& o_;
  const Reconstruction& r_;
  std::vector<Eigen::Vector3d> centres_, axes_;
  std::vector<double> travelled_;
};

// Squared Mahalanobis distance of each loop's pose, relative to its anchor, from what the reconstruction says.
std::vector<double> Surprise(const BundleProblem& p, const LoopFinder& finder, const LocalizeInput& input,
                             const LoopOptions& options, const std::vector<Loop>& loops, int threads,
                             const CancelToken& cancel) {
  const BundleCovariance covariance(p, threads, cancel);
  std::vector<double> surprise;
  for (const Loop& loop : loops) {
    const int a = loop.anchor, b = input.images[static_cast<size_t>(loop.image)].pose;
    const Eigen::MatrixXd joint = covariance.Joint({a, b});
    Matrix6d ja, jb;
    const Rigid3d& pose_a = p.poses[static_cast<size_t>(a)];
    RelativeJacobians(pose_a, p.poses[static_cast<size_t>(b)], &ja, &jb);
    const Matrix6d cross = ja * joint.topRightCorner<6, 6>() * jb.transpose();
    Matrix6d c = ja * joint.topLeftCorner<6, 6>() * ja.transpose() +
                 jb * joint.bottomRightCorner<6, 6>() * jb.transpose() + cross + cross.transpose();
    // Odometry and tracks drift in ways that no stepwise noise describes (a wheel's radius, a lens that is a little
    // off).
    const double path = loop.travelled - loop.anchor_travelled;
    c.diagonal().head<3>().array() += std::pow(options.drift_deg_m * kDegToRad * path, 2);
    c.diagonal().tail<3>().array() += std::pow(options.drift_part * path, 2);
    const Vector6d e = (pose_a * finder.Predicted(loop).Inverse()).Minus(pose_a * loop.body_from_odom.Inverse());
    surprise.push_back(e.dot(c.ldlt().solve(e)));
  }
  return surprise;
}

// The loops that are no surprise and that enough others nearby agree with.
std::vector<Loop> BelievedLoops(const LoopFinder& finder, const LoopOptions& options, const std::vector<Loop>& found,
                                const std::vector<double>& surprise) {
  std::vector<Loop> loops;
  for (size_t i = 0; i < found.size(); ++i) {
    int agreeing = 0;
    for (size_t k = 0; k < found.size(); ++k) {
      if (k != i && surprise[k] < options.gate_chi2 &&
          std::abs(found[k].travelled - found[i].travelled) < options.gap_m && finder.Agree(found[i], found[k]))
        ++agreeing;
    }
    if (surprise[i] < options.gate_chi2 && agreeing >= options.min_agreeing) loops.push_back(found[i]);
  }
  return loops;
}

// Bends the chain of poses until the traversals lie on each other.
void BendPoses(const LocalizeInput& input, const std::vector<Loop>& loops, const BundleOptions& bundle,
               BundleProblem* p, ProgressSink& progress, const CancelToken& cancel) {
  const size_t odometry = p->factors.size();
  for (const Loop& loop : loops) {
    PoseFactor f;
    f.kind = PoseFactor::Kind::kBetween;
    f.a = loop.anchor;
    f.b = input.images[static_cast<size_t>(loop.image)].pose;
    f.measured = p->poses[static_cast<size_t>(f.a)] * loop.body_from_odom.Inverse();
    f.sqrt_info.setZero();
    f.sqrt_info.diagonal() << Eigen::Vector3d::Constant(1 / (0.1 * kDegToRad)), Eigen::Vector3d::Constant(1 / 0.02);
    p->factors.push_back(f);
  }
  SolveBundle(*p, bundle, progress, cancel);
  p->factors.resize(odometry);
}

// The loops' observations; what the later traversal has tracked of the same features becomes one point with them.
int MergePoints(const LocalizeInput& input, const std::vector<Loop>& loops, double sigma_px, Reconstruction* r) {
  BundleProblem& p = r->problem;
  std::vector<int> into(p.points.size());
  std::iota(into.begin(), into.end(), 0);
  std::vector<bool> looped(input.images.size(), false);
  for (const Loop& loop : loops) looped[static_cast<size_t>(loop.image)] = true;
  std::vector<std::array<int, 3>> point_of;  // image, feature, point: of the loops' images, in this order
  for (size_t k = 0; k < p.observations.size(); ++k) {
    if (looped[static_cast<size_t>(r->image_of[k])])
      point_of.push_back({r->image_of[k], r->feature_of[k], p.observations[k].point});
  }
  std::sort(point_of.begin(), point_of.end());
  std::vector<ImageObservation> rows;
  int merged = 0;
  for (const Loop& loop : loops) {
    for (const ViewObservation& v : loop.inliers) {
      int earlier = v.point;
      while (into[static_cast<size_t>(earlier)] != earlier) earlier = into[static_cast<size_t>(earlier)];
      const auto known = std::lower_bound(point_of.begin(), point_of.end(), std::array<int, 3>{loop.image, v.feature});
      if (known != point_of.end() && (*known)[0] == loop.image && (*known)[1] == v.feature) {
        int later = (*known)[2];
        while (into[static_cast<size_t>(later)] != later) later = into[static_cast<size_t>(later)];
        if (later == earlier) continue;
        into[static_cast<size_t>(later)] = earlier;
      } else {
        const auto o = ObservationOf(input, {earlier, loop.image, v.feature, v.pixel}, sigma_px);
        if (!o) continue;
        rows.push_back({*o, loop.image, v.feature});
      }
      ++merged;
    }
  }
  for (BearingObservation& o : p.observations) {
    while (into[static_cast<size_t>(o.point)] != o.point) o.point = into[static_cast<size_t>(o.point)];
    o.active = true;
  }
  AddObservations(rows, r);
  return merged;
}

}  // namespace

LoopSummary CloseLoops(const LocalizeInput& input, const LoopOptions& options, const RegistrationOptions& registration,
                       const ReconstructOptions& reconstruct, Reconstruction* r, int threads, uint64_t seed,
                       ProgressSink& progress, const CancelToken& cancel) {
  LoopSummary summary;
  if (!options.close) return summary;
  BundleProblem& p = r->problem;
  const LoopFinder finder(input, options, *r);
  const std::vector<LoopQuery> queries = finder.Queries();
  summary.tried = static_cast<int>(queries.size());
  if (queries.empty()) return summary;
  const std::vector<Registration> answers =
      RegisterImages(input, *r, queries, registration, threads, seed, progress, cancel);
  ReturnFreeMemory();
  std::vector<Loop> found;
  for (size_t q = 0; q < queries.size(); ++q) {
    if (answers[q].status == AnswerStatus::kLocalized) found.push_back(finder.MakeLoop(queries[q], answers[q]));
  }
  summary.found = static_cast<int>(found.size());
  const std::vector<double> surprise = Surprise(p, finder, input, options, found, threads, cancel);
  const std::vector<Loop> loops = BelievedLoops(finder, options, found, surprise);
  summary.closed = static_cast<int>(loops.size());
  summary.contradicting = summary.found - summary.closed;
  if (loops.empty()) return summary;

  // First the chain of poses is bent: the drift is far larger than what the kernel of the observations would believe.
  // Then the observations take over.
  const std::vector<Rigid3d> before = p.poses;
  BundleOptions bundle;
  bundle.threads = threads;
  bundle.relative_cost_tolerance = 1e-4;
  BendPoses(input, loops, bundle, &p, progress, cancel);
  summary.merged_points = MergePoints(input, loops, r->sigma_px * r->correlation_inflation, r);
  Settle(reconstruct, 9 * reconstruct.outlier_chi2, r, threads, cancel);
  SolveBundle(p, bundle, progress, cancel);
  Settle(reconstruct, reconstruct.outlier_chi2, r, threads, cancel);
  bundle.relative_cost_tolerance = 0;
  r->summary = SolveBundle(p, bundle, progress, cancel);
  Settle(reconstruct, reconstruct.outlier_chi2, r, threads, cancel);
  for (size_t i = 0; i < before.size(); ++i) {
    summary.correction_m =
        std::max(summary.correction_m, (before[i].TargetOriginInSource() - p.poses[i].TargetOriginInSource()).norm());
  }
  return summary;
}

}  // namespace trigpoint
