// Errors along a run: east, north and up against time, with the band they should lie in.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "eval/report/drawing.h"

namespace trigpoint {

struct ErrorAlong {
  double time_s = 0;                       // since the run began
  std::optional<Eigen::Vector3d> error_m;  // east, north, up; unset: absent, and the line is broken
  std::optional<Eigen::Vector3d> sigma_m;  // 1 sigma of it: the reference's, and the estimate's where `stated`
  bool stated = false;                     // the estimate states a sigma of its own
  std::string object;                      // its image, see Spot
};

// Three panels, the band at two sigmas. At least one error.
Drawing ErrorRunChart(const std::vector<ErrorAlong>& run, const std::string& unit, double metres_per_unit);

}  // namespace trigpoint
