// What a photo of a hand-held set says of one point: the residual that SolveRig adds up.
#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

#include "survey/panorama/photo_pairs.h"

namespace trigpoint {

// sqrt_info (2 x 2, 1/px) (predicted - observed). Blocks: w (turn, rad: cam_from_rig = Exp(w) R0), centre (rig frame,
// m), lens (f px, k1, k2, p1, p2), point (two tangent components of its direction, inverse distance 1/m). Fails behind
// a straight lens.
class RigObservationCost final : public ceres::SizedCostFunction<2, 3, 3, kLensParameters, 3> {
 public:
  RigObservationCost(const PairView& view, bool fisheye, const Eigen::Quaterniond& cam_from_rig,
                     const Eigen::Vector3d& direction, const Eigen::Vector2d& pixel, const Eigen::Matrix2d& sqrt_info);
  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override;

 private:
  bool fisheye_;
  Eigen::Matrix2d sqrt_info_;
  Eigen::Vector2d offset_;         // principal point less observed pixel, px
  Eigen::Matrix2d shown_by_lens_;  // of p1, p2: DecentringIn of the view
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d direction_;
  Eigen::Matrix<double, 2, 3> basis_;
};

}  // namespace trigpoint
