#include "calib/estimation/manifold.h"

#include <Eigen/Core>

namespace trigpoint {
namespace {

// d(Exp(w) q)/dw at w = 0 with the full angle: half of the quaternion product matrix, rows x y z w.
Eigen::Matrix<double, 4, 3> HalfProduct(const double* q) {
  Eigen::Matrix<double, 4, 3> m;
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  m << w, z, -y, -z, w, x, y, -x, w, -x, -y, -z;
  return m;
}

}  // namespace

Rigid3d Rigid3FromBlock(const double* block) {
  return {Eigen::Quaterniond(block[3], block[0], block[1], block[2]), Eigen::Vector3d(block[4], block[5], block[6])};
}

void Rigid3ToBlock(const Rigid3d& pose, double* block) {
  Eigen::Map<Eigen::Vector4d>{block} = pose.rotation.coeffs();
  Eigen::Map<Eigen::Vector3d>{block + 4} = pose.translation;
}

bool Rigid3Manifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Vector6d> d(delta);
  Rigid3ToBlock(Rigid3FromBlock(x).Plus(d), x_plus_delta);
  return true;
}

bool Rigid3Manifold::PlusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> j(jacobian);
  j.setZero();
  j.topLeftCorner<4, 3>() = 0.5 * HalfProduct(x);
  j.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

bool Rigid3Manifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Vector6d>{y_minus_x} = Rigid3FromBlock(y).Minus(Rigid3FromBlock(x));
  return true;
}

bool Rigid3Manifold::MinusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> j(jacobian);
  j.setZero();
  j.topLeftCorner<3, 4>() = 2.0 * HalfProduct(x).transpose();
  j.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

}  // namespace trigpoint
