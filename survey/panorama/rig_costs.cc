#include "survey/panorama/rig_costs.h"

#include <cmath>

#include "calib/geometry/bearing.h"
#include "calib/geometry/so3.h"

namespace trigpoint {

RigObservationCost::RigObservationCost(const PairView& view, bool fisheye, const Eigen::Quaterniond& cam_from_rig,
                                       const Eigen::Vector3d& direction, const Eigen::Vector2d& pixel,
                                       const Eigen::Matrix2d& sqrt_info)
    : fisheye_(fisheye),
      sqrt_info_(sqrt_info),
      offset_(view.Principal() - pixel),
      rotation_(cam_from_rig.toRotationMatrix()),
      direction_(direction),
      basis_(TangentBasis(direction)) {
  for (int k = 0; k < 2; ++k) shown_by_lens_.col(k) = DecentringIn(view, Eigen::Vector2d::Unit(k));
}

bool RigObservationCost::Evaluate(const double* const* blocks, double* residuals, double** jacobians) const {
  using Row3 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  const Eigen::Map<const Eigen::Vector3d> w(blocks[0]), centre(blocks[1]), point(blocks[3]);
  const Eigen::Map<const Eigen::Matrix<double, kLensParameters, 1>> lens(blocks[2]);
  const Eigen::Matrix3d turn = ExpSO3(w).toRotationMatrix() * rotation_;
  const Eigen::Vector3d y = turn * (direction_ + basis_.transpose() * point.head<2>() - point(2) * centre);
  // q: undistorted picture coordinates over the focal length, and their derivative by y.
  Eigen::Vector2d q;
  Row3 q_by_y;
  const double across2 = y.head<2>().squaredNorm();
  if (fisheye_ && across2 > 1e-12) {
    const double across = std::sqrt(across2), theta = std::atan2(across, y.z()), length2 = across2 + y.z() * y.z();
    const Eigen::Vector2d n = y.head<2>() / across;
    q = theta * n;
    q_by_y.leftCols<2>() = (y.z() / length2 - theta / across) * n * n.transpose();
    q_by_y.leftCols<2>().diagonal().array() += theta / across;
    q_by_y.col(2) = -across / length2 * n;
  } else {
    if (y.z() < 0.02) return false;
    const double inverse = 1 / y.z();
    q = inverse * y.head<2>();
    q_by_y << inverse, 0, -inverse * q.x(), 0, inverse, -inverse * q.y();
  }
  const double r2 = q.squaredNorm(), radial = 1 + r2 * (lens(1) + r2 * lens(2));
  Eigen::Map<Eigen::Vector2d> r(residuals);
  const Eigen::Vector2d p = shown_by_lens_ * lens.tail<2>();
  const double p1 = p.x(), p2 = p.y();
  const Eigen::Vector2d distorted = radial * q + Decentring(p1, p2, q);
  r = sqrt_info_ * (lens(0) * distorted + offset_);
  if (jacobians == nullptr) return true;
  Eigen::Matrix2d by_q = 2 * (lens(1) + 2 * r2 * lens(2)) * q * q.transpose();
  by_q.diagonal().array() += radial;
  const double mixed = 2 * (p1 * q.x() + p2 * q.y());
  by_q +=
      (Eigen::Matrix2d() << 2 * p1 * q.y() + 6 * p2 * q.x(), mixed, mixed, 6 * p1 * q.y() + 2 * p2 * q.x()).finished();
  const Row3 by_y = lens(0) * sqrt_info_ * by_q * q_by_y;
  if (jacobians[0] != nullptr) {
    Eigen::Map<Row3> j(jacobians[0]);
    j = -by_y * Skew(y) * LeftJacobianSO3(w);
  }
  const Row3 by_rig = by_y * turn;
  if (jacobians[1] != nullptr) {
    Eigen::Map<Row3> j(jacobians[1]);
    j = -point(2) * by_rig;
  }
  if (jacobians[2] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 2, kLensParameters, Eigen::RowMajor>> j(jacobians[2]);
    j.col(0) = sqrt_info_ * distorted;
    j.col(1) = lens(0) * r2 * sqrt_info_ * q;
    j.col(2) = r2 * j.col(1);
    for (int k = 0; k < 2; ++k)
      j.col(3 + k) = lens(0) * sqrt_info_ * Decentring(shown_by_lens_(0, k), shown_by_lens_(1, k), q);
  }
  if (jacobians[3] != nullptr) {
    Eigen::Map<Row3> j(jacobians[3]);
    j.leftCols<2>() = by_rig * basis_.transpose();
    j.col(2) = -by_rig * centre;
  }
  return true;
}

}  // namespace trigpoint
