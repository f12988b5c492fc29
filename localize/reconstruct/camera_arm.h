// Do a body's cameras stand where their calibration puts them? Where a body turns, cameras that stand elsewhere move
// otherwise than odometry says.
#pragma once

#include <optional>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

struct ArmError {
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();  // true less stated place of all cameras, body axes
  double sigma_m = 0;                               // 1 sigma of its length
  bool significant = false;
};

// By a reconstruction that is solved, to first order: what odometry's residuals say of the place of all cameras on the
// body, beside odometry's scale (1 sigma `scale_sigma`) and the cameras' common rotation. What the path does not show
// to 0.1 m is left out; nothing where it shows nothing. Throws NumericError.
std::optional<ArmError> FindArmError(const Reconstruction& reconstruction, double scale_sigma, int threads,
                                     const CancelToken& cancel);

}  // namespace trigpoint
