// Least-squares alignment of two point sets (Umeyama 1991) and triangulation.
#pragma once

#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

enum class AlignmentKind { kYawTranslation, kSE3, kSim3 };

// target_from_source that minimises sum |target - T source|^2. Scale is 1 except for kSim3; kYawTranslation turns
// about +z only. Throws NumericError with fewer than 2 (yaw) or 3 points, or when the points are degenerate for
// the kind (coincident; collinear points leave the roll about their line free: the smallest rotation is taken).
Sim3d AlignPoints(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target,
                  AlignmentKind kind);

}  // namespace trigpoint
