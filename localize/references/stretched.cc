#include "localize/references/stretched.h"

#include <algorithm>
#include <cmath>

#include "calib/estimation/ransac.h"
#include "localize/reconstruct/minimal_solvers.h"

namespace trigpoint {
namespace {

// The ray of what the picture shows `factor` times as high above the horizon as it is.
Eigen::Vector3d Unstretched(const Eigen::Vector3d& ray, double factor) {
  const double across = std::hypot(ray.x(), ray.z());
  if (across == 0) return ray;
  const double elevation = std::atan2(-ray.y(), across) / factor;
  const double shrink = std::cos(elevation) / across;
  return {ray.x() * shrink, -std::sin(elevation), ray.z() * shrink};
}

}  // namespace

double StretchFactor(int k) { return std::pow(1.055, k - kStretchFactors / 2); }

std::vector<int> VoteForStretch(const std::vector<Eigen::Vector3d>& rays, const std::vector<Eigen::Vector3d>& points,
                                double threshold, uint64_t seed) {
  RansacOptions options;
  options.max_iterations = options.min_iterations = 100;  // four matches in ten true: one sample is so to 99.9 %
  options.threshold = threshold;
  std::vector<int> votes(kStretchFactors);
  std::vector<Eigen::Vector3d> as_seen(rays.size());
  for (int k = 0; k < kStretchFactors; ++k) {
    std::transform(rays.begin(), rays.end(), as_seen.begin(),
                   [&](const Eigen::Vector3d& ray) { return Unstretched(ray, StretchFactor(k)); });
    options.seed = seed + static_cast<uint64_t>(k);
    const auto best = Ransac<Rigid3d, 3>(
        static_cast<int>(rays.size()), options,
        [&](const std::vector<int>& sample) { return ThreePointPoses(as_seen, points, sample); },
        [&](const Rigid3d& pose, int i) {
          const auto at = static_cast<size_t>(i);
          return ((pose * points[at]).normalized() - as_seen[at]).norm();
        });
    votes[static_cast<size_t>(k)] = static_cast<int>(best.inliers.size());
  }
  return votes;
}

std::optional<int> StretchShown(const StretchVotes& votes) {
  // The best of so many factors fits a few more matches than the true one, by chance.
  constexpr double kClearly = 1.1, kSigmas = 3;
  if (votes.stretched.empty()) return std::nullopt;
  const auto best = std::max_element(votes.stretched.begin(), votes.stretched.end());
  const double more = *best - votes.as_it_is;
  if (more < (kClearly - 1) * votes.as_it_is || more < kSigmas * std::sqrt(votes.as_it_is + 1.0)) return std::nullopt;
  return static_cast<int>(best - votes.stretched.begin());
}

}  // namespace trigpoint
