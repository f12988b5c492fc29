// How errors of a lens move its pixels, and the cost of an observation through it; to first order.
#pragma once

#include "calib/camera/camera.h"
#include "localize/reconstruct/lens_bundle.h"

namespace trigpoint {

inline constexpr int kLensPointsPerImage = 60;
inline constexpr int kLensIterations = 10;
// 1 sigma of each error of a calibration with a board.
inline constexpr double kUsualLensError = 0.003;

// By each parameter of a lens (LensParameters): px, or whitened.
using LensShift = Eigen::Matrix<double, 2, kLensParameters>;

double HalfDiagonal(const Camera& camera);  // px

// How far a pixel moves (px) with each parameter of the lens: a share of the focal length, the principal point (px, two
// of them), and shares of radial distortion by r^2 and r^4, where r is 1 in the corners.
LensShift ShiftOf(const Camera& camera, const Eigen::Vector2d& pixel);

// The same of the pixel's ray, whitened by `w`. False where the camera has no rays about the pixel.
bool WhitenedShift(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Matrix<double, 2, 3>& w,
                   LensShift* shift);

// Whitened difference of a point's direction from the ray of an observation, as the lens moves it.
ceres::CostFunction* RayCostOf(const Rigid3d& cam_from_body, const BearingObservation& o, const LensShift& whitened);

}  // namespace trigpoint
