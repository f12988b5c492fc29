// How a body moves at given moments, from its trajectory.
#pragma once

#include <vector>

#include "calib/camera/rolling_shutter.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

// At each of the stamps, from the poses a step of the trajectory before and after it (at its ends: of one). Unknown
// outside of it, in gaps, and where the steps are so long that a body may move otherwise in between.
std::vector<MotionRate> RatesAt(const Trajectory& trajectory, const std::vector<int64_t>& stamps);

}  // namespace trigpoint
