#include "datasets/io/odometry_limits.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

namespace trigpoint {
namespace {

constexpr int64_t kSecond_ns = 1'000'000'000;

// Whether steps differ as those of times do that are cut off. A few longer ones are images that are missing.
bool AreUneven(const std::vector<int64_t>& steps) {
  constexpr double kFew = 0.15;
  const int64_t least = *std::min_element(steps.begin(), steps.end());
  const auto longer = std::count_if(steps.begin(), steps.end(), [&](int64_t step) { return step > least; });
  const bool multiples = std::all_of(steps.begin(), steps.end(), [&](int64_t step) { return step % least == 0; });
  return !multiples || (least == kSecond_ns && static_cast<double>(longer) > kFew * static_cast<double>(steps.size()));
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
  std::set<std::pair<int, int64_t>> seen;  // by each camera
  bool twice = false;
  for (const ImageEntry& image : run.images) {
    if (!whole(image.stamp_ns)) return 0;
    twice = !seen.insert({image.camera, image.stamp_ns}).second || twice;
  }
  std::vector<int64_t> steps;
  for (auto a = seen.begin(); a != seen.end() && std::next(a) != seen.end(); ++a) {
    const auto b = std::next(a);
    if (a->first == b->first) steps.push_back(b->second - a->second);
  }
  if (steps.size() < kLeastSteps) return 0;
  return twice || AreUneven(steps) ? 1 : 0;
}

}  // namespace trigpoint
