// Residual and derivatives of a point that is seen along a ray: the one observation that all sparse problems share.
#pragma once

#include <Eigen/Core>

#include "calib/geometry/rigid3.h"
#include "calib/geometry/so3.h"

namespace trigpoint {

// Whitened: by the pose's left tangent [rotation, translation] and by the point.
struct ObservationTerms {
  Eigen::Vector2d r = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 6> jp = Eigen::Matrix<double, 2, 6>::Zero();
  Eigen::Matrix<double, 2, 3> jy = Eigen::Matrix<double, 2, 3>::Zero();
};

// r = W unit(view_from_rig * (rig_from_world * y)), where W `ray` = 0 (view frame) and y lies in the world. False
// behind the view. Without kJacobians only the residual.
template <bool kJacobians>
inline bool EvaluateBearing(const Rigid3d& rig_from_world, const Rigid3d& view_from_rig,
                            const Eigen::Matrix<double, 2, 3>& w, const Eigen::Vector3d& ray, const Eigen::Vector3d& y,
                            ObservationTerms* out) {
  const Eigen::Matrix3d rotation = rig_from_world.rotation.toRotationMatrix(),
                        of_view = view_from_rig.rotation.toRotationMatrix();
  const Eigen::Vector3d rotated = rotation * y;
  const Eigen::Vector3d q = of_view * (rotated + rig_from_world.translation) + view_from_rig.translation;
  const double n = q.norm();
  if (!(n > 1e-9)) return false;
  const Eigen::Vector3d u = q / n;
  if (u.dot(ray) <= 0) return false;
  out->r = w * u;
  if constexpr (kJacobians) {
    const Eigen::Matrix<double, 2, 3> dq = (w - out->r * u.transpose()) / n;  // W (I - u u^T) / n
    const Eigen::Matrix<double, 2, 3> by_rig = dq * of_view;
    out->jp.leftCols<3>() = -by_rig * Skew(rotated);
    out->jp.rightCols<3>() = by_rig;
    out->jy = by_rig * rotation;
  }
  return true;
}

}  // namespace trigpoint
