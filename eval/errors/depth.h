// How well a run's geometry supports an answer: parallax and distance of the structure around it. A panorama whose
// surroundings are far away or were seen from one direction only is not to be trusted, however many matches it has.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "datasets/colmap/model.h"
#include "eval/errors/results.h"
#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// A triangulated point of a run: where it is in the run's own frame, and the largest angle between two of its rays.
struct StructurePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double parallax_rad = 0;
};

// Of a model in the run's own frame: its points with two rays or more.
std::vector<StructurePoint> StructureOf(const SparseModel& model);

struct DepthSupport {
  double structure_m = 0;    // median distance of the points around
  double parallax_deg = 0;   // their median parallax
  double depth_sigma_m = 0;  // distance of a point / parallax * ray_sigma: how far depth may be off, median
};
// Of the points within `radius_m`; unset with fewer than ten.
std::optional<DepthSupport> SupportAt(const std::vector<StructurePoint>& points, const Eigen::Vector3d& odom_position,
                                      double radius_m, double ray_sigma_rad);

// Answers in the order in which they would be trusted.
struct RiskPoint {
  double coverage = 0;                        // share of the answers that are kept
  double threshold = 0;                       // of what they are ordered by
  double median_m = 0, p90_m = 0, max_m = 0;  // 3D error of those
};
// `order[i]` small: trusted first.
std::vector<RiskPoint> CoverageRisk(const std::vector<double>& order, const std::vector<double>& errors);

}  // namespace trigpoint
