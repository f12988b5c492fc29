#include "datasets/io/odometry_limits.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace trigpoint {
namespace {

constexpr int64_t kSecond_ns = 1'000'000'000;

// Whether steps are of n and n + 1 seconds, as those of even times that were cut off. A few others are images that are
// missing.
bool AreUneven(const std::vector<int64_t>& steps) {
  constexpr double kFew = 0.15;
  const int64_t least = *std::min_element(steps.begin(), steps.end());
  const auto share = [&](int64_t step) {
    return static_cast<double>(std::count(steps.begin(), steps.end(), step)) / static_cast<double>(steps.size());
  };
  const double shorter = share(least), longer = share(least + kSecond_ns);
  return shorter > kFew && longer > kFew && shorter + longer > 1 - kFew;
}

}  // namespace

bool IsFlat(const Trajectory& odometry) {
  constexpr size_t kLeastPoses = 10;
  constexpr double kSame = 1e-6;
  if (odometry.poses.size() < kLeastPoses) return false;
  const Rigid3d& first = odometry.poses.front().target_from_body;
  return std::all_of(odometry.poses.begin(), odometry.poses.end(), [&](const TimedPose& pose) {
    const Rigid3d& p = pose.target_from_body;
    const Eigen::Vector3d up = p.rotation * Eigen::Vector3d::UnitZ();
    return up.head<2>().norm() < kSame && std::abs(p.translation.z() - first.translation.z()) < kSame;
  });
}

double TimeResolution(const Run& run) {
  constexpr size_t kLeastSteps = 5;
  const auto whole = [](int64_t stamp_ns) { return stamp_ns % kSecond_ns == 0; };
  const auto& poses = run.odometry.poses;
  if (std::all_of(poses.begin(), poses.end(), [&](const TimedPose& pose) { return whole(pose.stamp_ns); })) return 0;
  std::vector<int64_t> steps;
  std::map<int, int64_t> last;  // of each camera
  for (const ImageEntry& image : run.images) {
    if (!whole(image.stamp_ns)) return 0;
    const auto [before, first] = last.try_emplace(image.camera, image.stamp_ns);
    if (!first) steps.push_back(image.stamp_ns - std::exchange(before->second, image.stamp_ns));
  }
  return steps.size() >= kLeastSteps && AreUneven(steps) ? 1 : 0;
}

}  // namespace trigpoint
