// Surveyed points from above: residuals as arrows, with the ellipses they should lie in.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "eval/report/plan.h"

namespace trigpoint {

struct SurveyPlanPoint {
  std::string name;
  bool control = true;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();     // east, north
  Eigen::Vector2d residual_m = Eigen::Vector2d::Zero();  // map minus stated
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Zero();
};

// `tags`: further tags, without a surveyed place. At least one point.
Plan SurveyPlanOf(const std::vector<SurveyPlanPoint>& points, const std::vector<Eigen::Vector2d>& tags,
                  const std::string& unit, double metres_per_unit);

}  // namespace trigpoint
