// Is a metre of a run's odometry equally long in all horizontal directions?
#pragma once

#include <optional>
#include <vector>

#include "calib/geometry/pose_readings.h"

namespace trigpoint {

struct OdometryStretch {
  double ratio = 1;        // of a metre of odometry along the axis to one across it, at least 1
  double sigma_ratio = 0;  // 1 sigma
  double axis_rad = 0;     // in odometry's frame, from x towards y
  double turned_rad = 0;   // by how much a direction of motion is off at most
  double sigma_rad = 0;    // 1 sigma of it
  int motions = 0;
};

// The stretch of odometry's horizontal positions that agrees best with the directions of motion that images show, which
// are turned into odometry's frame by its rotations. A common turn of all directions (the camera's mount) is estimated
// beside it. Least squares with Huber's weights; the noise is found from the residuals. Nothing where fewer than twelve
// motions have a direction, or where the path is too straight to tell a stretch from a turn.
std::optional<OdometryStretch> FindStretch(const std::vector<Rigid3d>& odom_from_body,
                                           const std::vector<MeasuredMotion>& motions);

}  // namespace trigpoint
