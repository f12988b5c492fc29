// Rotations: exponential map, Jacobians. The full angle is used throughout (no half angles).
//
// Bodies stand in the source: every file that includes this would compile them again.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint {

Eigen::Matrix3d Skew(const Eigen::Vector3d& v);

// Exp: rotation vector (rad) to unit quaternion; exact near zero.
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& w);

// Log: unit quaternion to rotation vector (rad), |w| <= pi.
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& q_in);

// Left Jacobian J_l(w): Exp(w + d) ~ Exp(J_l d) Exp(w).
Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& w);

// Inverse of the left Jacobian: Log(Exp(d) Exp(w)) ~ w + J_l^-1 d.
Eigen::Matrix3d LeftJacobianInverseSO3(const Eigen::Vector3d& w);

// Angle between two rotations, rad, in [0, pi].
double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

}  // namespace trigpoint
