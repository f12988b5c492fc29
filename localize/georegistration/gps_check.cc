#include "localize/georegistration/gps_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/median.h"

namespace trigpoint {

void HeedGps(const BundleProblem& problem, const std::vector<GpsPlace>& gps, GeoRegistration* geo) {
  constexpr size_t kLeastFixes = 5;
  constexpr double kSigmas = 4, kLeast_m = 10, kHeightSigmas = 5, kLeastHeight_m = 15;
  if (!geo->solved || gps.size() < kLeastFixes) return;
  std::vector<double> off[3], sigma_h, sigma_v;
  for (const GpsPlace& g : gps) {
    const Eigen::Vector3d odom = problem.poses[static_cast<size_t>(g.pose)].Inverse() * g.arm_m;
    const Eigen::Vector3d difference = g.position - geo->world_from_odom * odom;
    for (int k = 0; k < 3; ++k) off[k].push_back(difference(k));
    sigma_h.push_back(g.sigma_h_m);
    sigma_v.push_back(g.sigma_v_m);
  }
  const Eigen::Vector3d middle(Median(off[0]), Median(off[1]), Median(off[2]));
  // The places of the fit are known to its covariance, too.
  const double own_h = std::sqrt(geo->covariance(3, 3) + geo->covariance(4, 4)),
               own_v = std::sqrt(geo->covariance(5, 5));
  const double horizontal_sigma = std::hypot(Median(sigma_h), own_h),
               vertical_sigma = std::hypot(Median(sigma_v), own_v);
  const bool horizontal = middle.head<2>().norm() > std::max(kLeast_m, kSigmas * horizontal_sigma);
  const bool vertical = std::abs(middle.z()) > std::max(kLeastHeight_m, kHeightSigmas * vertical_sigma);
  if (!horizontal && !vertical) return;
  // All of it: far off, a level shift changes heights, too, by the Earth's curvature.
  geo->covariance.block<3, 3>(3, 3) += middle * middle.transpose();
  geo->reason += fmt::format(
      "{}GPS lies {:.0f} m {} the run as the geotags place it (GPS, 1 sigma: {:.1f} m): one of the two is wrong, and "
      "the difference is part of the result's sigmas; check positions, heights (above the ellipsoid) and origin",
      geo->reason.empty() ? "" : "; ", horizontal ? middle.norm() : std::abs(middle.z()), horizontal ? "from" : "above or below",
      horizontal ? horizontal_sigma : vertical_sigma);
}

}  // namespace trigpoint
