// Residuals and derivatives of one term of a bundle adjustment; what bundle.cc sums up.
#pragma once

#include "calib/estimation/bundle.h"
#include "calib/geometry/so3.h"

namespace trigpoint {

// Of a bearing observation, whitened: by the pose's left tangent [rotation, translation] and by the point.
struct ObservationTerms {
  Eigen::Vector2d r = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 6> jp = Eigen::Matrix<double, 2, 6>::Zero();
  Eigen::Matrix<double, 2, 3> jy = Eigen::Matrix<double, 2, 3>::Zero();
};

// At point `y` and the problem's poses. False behind the view. Without kJacobians only the residual.
template <bool kJacobians>
inline bool Evaluate(const BundleProblem& p, const BearingObservation& o, const Eigen::Vector3d& y,
                     ObservationTerms* out) {
  const Rigid3d& pose = p.poses[static_cast<size_t>(o.pose)];
  const Rigid3d& view = p.views[static_cast<size_t>(o.view)];
  const Eigen::Matrix3d rig_from_world = pose.rotation.toRotationMatrix(),
                        view_from_rig = view.rotation.toRotationMatrix();
  const Eigen::Vector3d in_rig_rotated = rig_from_world * y;
  const Eigen::Vector3d q = view_from_rig * (in_rig_rotated + pose.translation) + view.translation;
  const double n = q.norm();
  if (!(n > 1e-9)) return false;
  const Eigen::Vector3d u = q / n;
  if (u.dot(o.ray.cast<double>()) <= 0) return false;
  const Eigen::Matrix<double, 2, 3> w = o.w.cast<double>();
  out->r = w * u;
  if constexpr (kJacobians) {
    const Eigen::Matrix<double, 2, 3> dq = (w - out->r * u.transpose()) / n;  // W (I - u u^T) / n
    const Eigen::Matrix<double, 2, 3> drig = dq * view_from_rig;
    out->jp.leftCols<3>() = -drig * Skew(in_rig_rotated);
    out->jp.rightCols<3>() = drig;
    out->jy = drig * rig_from_world;
  }
  return true;
}

// Of a pose factor, whitened: by both poses' left tangents and its scale.
struct FactorTerms {
  Vector6d r = Vector6d::Zero();
  Matrix6d ja = Matrix6d::Zero(), jb = Matrix6d::Zero();
  Vector6d js = Vector6d::Zero();
};
void EvaluateFactor(const BundleProblem& p, const PoseFactor& f, FactorTerms* out);

// Of a map, whitened: by the left tangents of its rigs' poses, 6 columns each, and last of its frame's, where that is a
// pose.
struct MapTerms {
  Eigen::VectorXd r;
  Eigen::MatrixXd j;
};
MapTerms EvaluateMap(const BundleProblem& p, const MapFactor& map);

}  // namespace trigpoint
