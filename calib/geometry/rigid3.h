// Rigid transforms, named target_from_source: p_in_cam = cam_from_world * p_in_world.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "calib/geometry/so3.h"

namespace trigpoint {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// b_from_a: p_b = rotation * p_a + translation. Tangent [rotation (rad), translation (m)], rotation first:
// Plus(w, d): R' = Exp(w) R, t' = t + d. Covariances are of this tangent.
struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q.normalized()), translation(t) {}

  Rigid3d Inverse() const {
    const Eigen::Quaterniond q = rotation.conjugate();
    return {q, -(q * translation)};
  }
  // The target's origin in source coordinates (the camera centre of a cam_from_world).
  Eigen::Vector3d TargetOriginInSource() const { return -(rotation.conjugate() * translation); }

  Rigid3d Plus(const Vector6d& delta) const {
    return {ExpSO3(delta.head<3>()) * rotation, translation + delta.tail<3>()};
  }
  // The tangent that takes `other` to this: this = other.Plus(result).
  Vector6d Minus(const Rigid3d& other) const {
    Vector6d d;
    d << LogSO3(rotation * other.rotation.conjugate()), translation - other.translation;
    return d;
  }
  bool IsFinite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }
};

inline Eigen::Vector3d operator*(const Rigid3d& t, const Eigen::Vector3d& p) { return t.rotation * p + t.translation; }

// c_from_a = c_from_b * b_from_a
inline Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation, c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

// d Inverse / d pose, both in left tangents: the tangent of a_from_b that belongs to a small one of b_from_a.
inline Matrix6d InverseJacobian(const Rigid3d& b_from_a) {
  const Eigen::Matrix3d rt = b_from_a.rotation.conjugate().toRotationMatrix();
  Matrix6d j = Matrix6d::Zero();
  j.topLeftCorner<3, 3>() = -rt;
  // t_inv = -(Exp(w) R)^T (t + d) = -R^T (I - [w]x)(t + d)  =>  d t_inv = -R^T d - R^T [t]x w
  j.bottomLeftCorner<3, 3>() = -rt * Skew(b_from_a.translation);
  j.bottomRightCorner<3, 3>() = -rt;
  return j;
}

// Covariance of the inverse transform, tangent as above.
inline Matrix6d InverseCovariance(const Rigid3d& b_from_a, const Matrix6d& covariance) {
  const Matrix6d j = InverseJacobian(b_from_a);
  return j * covariance * j.transpose();
}

// Derivatives of a_from_b = a_from_world * b_from_world^-1 by both poses, all in left tangents.
inline void RelativeJacobians(const Rigid3d& a_from_world, const Rigid3d& b_from_world, Matrix6d* by_a,
                              Matrix6d* by_b) {
  const Eigen::Matrix3d r = (a_from_world.rotation * b_from_world.rotation.conjugate()).toRotationMatrix();
  const Eigen::Vector3d rtb = r * b_from_world.translation;
  by_a->setIdentity();
  by_a->bottomLeftCorner<3, 3>() = Skew(rtb);
  by_b->setZero();
  by_b->topLeftCorner<3, 3>() = -r;
  by_b->bottomLeftCorner<3, 3>() = -Skew(rtb) * r;
  by_b->bottomRightCorner<3, 3>() = -r;
}

// Slerp and linear interpolation between two poses, s in [0, 1] (extrapolates outside).
inline Rigid3d Interpolate(const Rigid3d& a, const Rigid3d& b, double s) {
  const Eigen::Vector3d w = LogSO3(b.rotation * a.rotation.conjugate());
  return {ExpSO3(s * w) * a.rotation, (1 - s) * a.translation + s * b.translation};
}

// Similarity: p_b = scale * rotation * p_a + translation.
struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3d Inverse() const {
    const Eigen::Quaterniond q = rotation.conjugate();
    return {1.0 / scale, q, -(q * translation) / scale};
  }
  // A pose b_from_x of a body whose pose in a is given.
  Rigid3d TransformPose(const Rigid3d& a_from_x) const {
    return {rotation * a_from_x.rotation, scale * (rotation * a_from_x.translation) + translation};
  }
};

inline Eigen::Vector3d operator*(const Sim3d& t, const Eigen::Vector3d& p) {
  return t.scale * (t.rotation * p) + t.translation;
}

inline Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {c_from_b.scale * b_from_a.scale, c_from_b.rotation * b_from_a.rotation,
          c_from_b.scale * (c_from_b.rotation * b_from_a.translation) + c_from_b.translation};
}

}  // namespace trigpoint
