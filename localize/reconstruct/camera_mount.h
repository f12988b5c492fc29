// Does a camera stand on the body as its calibration states? Motions of the camera are compared with odometry's, which
// a wrong rotation turns all alike.
#pragma once

#include <optional>
#include <vector>

#include "calib/geometry/pose_readings.h"

namespace trigpoint {

struct MountError {
  // Rotation vector of stated_cam_from_true_cam, rad, camera axes (right, down, forward); of it what is not known to a
  // degree is left out.
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  double sigma_rad = 0;  // 1 sigma of its length
  int motions = 0;
};

// The rotation between the camera as it is and as `sensor_from_body` of its motions has it, by their rotations and
// directions: b_from_a as measured = R (b_from_a by odometry) R^-1. Least squares with Huber's weights; the noise is
// found from the residuals. Nothing where fewer than eight motions with a direction can be compared or no axis is known
// to a degree. All motions must be of one camera.
std::optional<MountError> FindMountError(const std::vector<Rigid3d>& odom_from_body,
                                         const std::vector<MeasuredMotion>& motions);

}  // namespace trigpoint
