// The manifold of a 7-block [qx qy qz qw tx ty tz]: R' = Exp(w) R, t' = t + d, |w| the full angle.
// Ceres' own quaternion manifolds use half of it, so that their covariances are a quarter of these.
#pragma once

#include <ceres/manifold.h>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

class Rigid3Manifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// Derivative by the tangent (rows x 6) to derivative by the 7-block, row by row, such that the manifold's PlusJacobian
// gives it back.
template <typename Derived>
void ToAmbient(const Eigen::MatrixBase<Derived>& by_tangent, const double* block, double* jacobian) {
  constexpr int kRows = Derived::RowsAtCompileTime;
  const Eigen::Matrix<double, kRows, 6> evaluated = by_tangent;
  Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
  Rigid3Manifold().MinusJacobian(block, minus.data());
  Eigen::Map<Eigen::Matrix<double, kRows, 7, Eigen::RowMajor>>{jacobian} = evaluated * minus;
}

// Reads and writes a 7-block.
Rigid3d Rigid3FromBlock(const double* block);
void Rigid3ToBlock(const Rigid3d& pose, double* block);

}  // namespace trigpoint
