// Rolling shutters: the rows of an image are exposed one after the other while the camera moves.
//
// An image's time is that of its middle row; row v of h is exposed (v / (h - 1) - 1/2) readout later. To first order a
// point X' in the camera at that moment is, in the camera at the image's time,
//   X = Exp(dt omega) X' + dt velocity,
// with omega and velocity the camera's own, in its own frame.
#pragma once

#include <Eigen/Core>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

// How a frame turns (rad/s) and moves (m/s), in its own axes.
struct MotionRate {
  Eigen::Vector3d omega = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();
  bool known = false;
};

// Of a body whose poses `seconds` apart are a and b, in the axes of the pose between them.
MotionRate RateBetween(const Rigid3d& target_from_a, const Rigid3d& target_from_b, const Rigid3d& target_from_between,
                       double seconds);

// The same motion of a camera that is mounted on the body.
MotionRate RateOfCamera(const MotionRate& body, const Rigid3d& cam_from_body);

// When a row is exposed, as a share of the readout time after the image's time: -1/2 to 1/2.
double RowOffset(const Camera& camera, double v);

// The pixel where a camera at the image's time would have seen what this one saw at `pixel`, `inverse_distance` (1/m;
// 0: far away) from it. The pixel itself where the model has no ray for it or the rate is unknown.
Eigen::Vector2d PixelAtImageTime(const Camera& camera, double readout_s, const Eigen::Vector2d& pixel,
                                 const MotionRate& rate, double inverse_distance);

}  // namespace trigpoint
