// The measurement equation of a tag: four corners in a calibrated picture.
//
//   p_cam = cam_from_body * world_from_body^-1 * world_from_tag * corner_k
//   r_k   = W_k * p_cam / |p_cam|                     (2 each, 8 in all, whitened)
//
// W_k comes from Camera::BearingSqrtInfo at the observed pixel, so that W_k * (observed ray) = 0 and the residual is
// predicted minus observed in units of the corner's sigma. It holds for every central camera and never fails to
// evaluate.
#pragma once

#include <Eigen/Core>
#include <array>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "survey/tags/detection.h"

namespace trigpoint {

using Vector8d = Eigen::Matrix<double, 8, 1>;
using Matrix86d = Eigen::Matrix<double, 8, 6>;

// A detection as a solver sees it.
struct TagSight {
  std::array<Eigen::Matrix<double, 2, 3>, 4> whitening;  // W_k
  std::array<Eigen::Vector3d, 4> rays;                   // observed, unit, camera frame
  std::array<double, 4> sigma_px;
  // W_k * ray of the pixel 1 px farther from the tag's centre than the observed corner.
  Eigen::Matrix<double, 8, 1> outward = Eigen::Matrix<double, 8, 1>::Zero();
};

// Throws NumericError where a corner has no ray in this camera. `extra_sigma_px` is added in quadrature.
TagSight MakeTagSight(const Camera& camera, const TagDetection& detection, double extra_sigma_px = 0);

// Whitened residual, with its derivatives by the left tangents of world_from_body and world_from_tag if given.
Vector8d TagResidual(const TagSight& sight, double size_m, const Rigid3d& cam_from_body, const Rigid3d& world_from_body,
                     const Rigid3d& world_from_tag, Matrix86d* by_body = nullptr, Matrix86d* by_tag = nullptr);

// All corners in front of the camera, within 90 degrees of the observed rays, and the tag seen from its printed side?
bool TagFaces(const TagSight& sight, double size_m, const Rigid3d& cam_from_tag);

// Root mean square distance of the corners in pixels, per axis, of a whitened residual.
double ResidualPx(const TagSight& sight, const Vector8d& residual);

}  // namespace trigpoint
