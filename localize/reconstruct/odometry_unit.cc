#include "localize/reconstruct/odometry_unit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/base/median.h"
#include "calib/geo/unit_of_length.h"

namespace trigpoint {
namespace {

// Root mean square distance from the middle, m.
double Extent(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : places) mean += p / static_cast<double>(places.size());
  double square = 0;
  for (const Eigen::Vector3d& p : places) square += (p - mean).squaredNorm() / static_cast<double>(places.size());
  return std::sqrt(square);
}

}  // namespace

std::optional<std::string> FindOtherUnit(const Run& run) {
  constexpr size_t kLeastFixes = 5;
  constexpr double kSigmas = 5, kFactor = 2, kLeastExtent = 3;
  constexpr int64_t kLongestGap_ns = 1'000'000'000;
  std::vector<Eigen::Vector3d> by_odometry, by_gps;
  std::vector<double> sigmas;
  for (const GpsFix& fix : run.gps) {
    const auto pose = run.odometry.At(fix.stamp_ns, kLongestGap_ns);
    if (!pose) continue;
    const LocalFrame frame(run.gps.front().position);
    by_odometry.push_back(*pose * run.config.gps_lever_arm_m);
    by_gps.push_back(frame.EnuFromGeodetic(fix.position));
    by_gps.back().z() = 0;  // the worst known, and nearly the same everywhere
    sigmas.push_back(fix.sigma_h_m);
  }
  if (sigmas.size() < kLeastFixes) return std::nullopt;
  const double sigma = Median(std::move(sigmas)), ours = Extent(by_odometry), theirs = Extent(by_gps);
  if (theirs < kLeastExtent * sigma || !(ours > 0)) return std::nullopt;
  const double factor = theirs / ours;
  if (std::abs(theirs - ours) < kSigmas * std::hypot(sigma, run.config.odometry_scale_sigma * ours))
    return std::nullopt;
  if (factor < kFactor && factor > 1 / kFactor) return std::nullopt;
  const std::string unit = UnitOfLength(factor, 0.15 + 2 * sigma / theirs);
  return fmt::format(
      "{}: the run extends over {:.1f} m by its positions, and over {:.1f} m by GPS (1 sigma: {:.1f} m); expected "
      "metres{}. Convert the positions to metres. Option --set reconstruct.check_conventions=false skips this check",
      (run.dir / "odometry.tum").string(), ours, theirs, sigma, unit.empty() ? "" : ", found what may be " + unit);
}

}  // namespace trigpoint
