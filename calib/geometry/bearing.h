// Bearing vectors and their tangent planes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint {

// Two unit vectors that span the plane orthogonal to the unit vector `ray`, as rows (2 x 3).
// Right-handed: row0 x row1 = ray. Well defined everywhere, the optical axis included.
inline Eigen::Matrix<double, 2, 3> TangentBasis(const Eigen::Vector3d& ray) {
  // Cross with the axis of the smallest component: never near-parallel.
  Eigen::Index axis = 0;
  ray.cwiseAbs().minCoeff(&axis);
  const Eigen::Vector3d b1 = ray.cross(Eigen::Vector3d::Unit(axis)).normalized();
  Eigen::Matrix<double, 2, 3> basis;
  basis.row(0) = b1;
  basis.row(1) = ray.cross(b1);
  return basis;
}

// Angle between two directions (need not be unit), rad, accurate for small angles.
inline double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace trigpoint
