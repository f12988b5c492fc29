// How uncertainty goes through a similarity.
#pragma once

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// Derivatives of b_from_x = b_from_a.TransformPose(a_from_x), a left tangent, by that of a_from_x and by the
// similarity's [rotation (rad, left), translation (m), scale].
inline void SimilarityJacobians(const Sim3d& b_from_a, const Rigid3d& a_from_x, Matrix6d* by_pose,
                                Eigen::Matrix<double, 6, 7>* by_similarity) {
  const Eigen::Matrix3d rotation = b_from_a.rotation.toRotationMatrix();
  by_pose->setZero();
  by_pose->topLeftCorner<3, 3>() = rotation;
  by_pose->bottomRightCorner<3, 3>() = b_from_a.scale * rotation;
  const Eigen::Vector3d rotated = b_from_a.rotation * a_from_x.translation;
  by_similarity->setZero();
  by_similarity->topLeftCorner<3, 3>().setIdentity();
  by_similarity->bottomLeftCorner<3, 3>() = -b_from_a.scale * Skew(rotated);
  by_similarity->block<3, 3>(3, 3).setIdentity();
  by_similarity->block<3, 1>(3, 6) = rotated;
}

}  // namespace trigpoint
