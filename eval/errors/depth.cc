#include "eval/errors/depth.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "calib/geo/geodetic.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
std::vector<StructurePoint> StructureOf(const SparseModel& model) {
  std::unordered_map<uint32_t, Eigen::Vector3d> centres;
  for (const ModelImage& image : model.images) centres[image.id] = image.cam_from_world.TargetOriginInSource();
  std::vector<StructurePoint> points;
  for (const ModelPoint& p : model.points) {
    StructurePoint point;
    point.position = p.position;
    std::vector<Eigen::Vector3d> rays;
    for (const auto& [image, index] : p.track) {
      const auto centre = centres.find(image);
      if (centre != centres.end()) rays.push_back((point.position - centre->second).normalized());
    }
    // Cameras move along a path: the widest angle has the first or the last one at an end.
    double least = 1;
    for (const Eigen::Vector3d& ray : rays) least = std::min({least, ray.dot(rays.front()), ray.dot(rays.back())});
    point.parallax_rad = std::acos(std::clamp(least, -1.0, 1.0));
    if (rays.size() >= 2) points.push_back(point);
  }
  return points;
}

std::optional<DepthSupport> SupportAt(const std::vector<StructurePoint>& points, const Eigen::Vector3d& odom_position,
                                      double radius_m, double ray_sigma_rad) {
  std::vector<double> distance, parallax, sigma;
  for (const StructurePoint& p : points) {
    const double d = (p.position - odom_position).norm();
    if (d > radius_m) continue;
    distance.push_back(d);
    parallax.push_back(p.parallax_rad);
    sigma.push_back(d / std::max(1e-4, p.parallax_rad) * ray_sigma_rad);
  }
  if (distance.size() < 10) return std::nullopt;
  return DepthSupport{Quantile(distance, 0.5), kRadToDeg * Quantile(parallax, 0.5), Quantile(sigma, 0.5)};
}

std::vector<RiskPoint> CoverageRisk(const std::vector<double>& order, const std::vector<double>& errors) {
  std::vector<size_t> index(order.size());
  std::iota(index.begin(), index.end(), size_t{0});
  std::stable_sort(index.begin(), index.end(), [&](size_t a, size_t b) { return order[a] < order[b]; });
  std::vector<RiskPoint> curve;
  std::vector<double> kept;
  for (const size_t i : index) {
    kept.push_back(errors[i]);
    curve.push_back({static_cast<double>(kept.size()) / static_cast<double>(order.size()), order[i],
                     Quantile(kept, 0.5), Quantile(kept, 0.9), *std::max_element(kept.begin(), kept.end())});
  }
  return curve;
}

}  // namespace trigpoint
