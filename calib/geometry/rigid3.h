// Rigid transforms, named target_from_source: p_in_cam = cam_from_world * p_in_world.
//
// Bodies stand in the source, but for those of inner loops: every file that includes this would compile them again.
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

  Rigid3d Inverse() const;
  // The target's origin in source coordinates (the camera centre of a cam_from_world).
  Eigen::Vector3d TargetOriginInSource() const;

  Rigid3d Plus(const Vector6d& delta) const;
  // The tangent that takes `other` to this: this = other.Plus(result).
  Vector6d Minus(const Rigid3d& other) const;
  bool IsFinite() const;
};

inline Eigen::Vector3d operator*(const Rigid3d& t, const Eigen::Vector3d& p) { return t.rotation * p + t.translation; }

// c_from_a = c_from_b * b_from_a
Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a);

// d Inverse / d pose, both in left tangents: the tangent of a_from_b that belongs to a small one of b_from_a.
Matrix6d InverseJacobian(const Rigid3d& b_from_a);

// Covariance of the inverse transform, tangent as above.
Matrix6d InverseCovariance(const Rigid3d& b_from_a, const Matrix6d& covariance);

// Derivatives of a_from_b = a_from_world * b_from_world^-1 by both poses, all in left tangents.
void RelativeJacobians(const Rigid3d& a_from_world, const Rigid3d& b_from_world, Matrix6d* by_a, Matrix6d* by_b);

// Slerp and linear interpolation between two poses, s in [0, 1] (extrapolates outside).
Rigid3d Interpolate(const Rigid3d& a, const Rigid3d& b, double s);

// Similarity: p_b = scale * rotation * p_a + translation.
struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3d Inverse() const;
  // A pose b_from_x of a body whose pose in a is given.
  Rigid3d TransformPose(const Rigid3d& a_from_x) const;
};

Eigen::Vector3d operator*(const Sim3d& t, const Eigen::Vector3d& p);

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a);

}  // namespace trigpoint
