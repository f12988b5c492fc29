#include "calib/geometry/rigid3.h"

namespace trigpoint {

Rigid3d Rigid3d::Inverse() const {
  const Eigen::Quaterniond q = rotation.conjugate();
  return {q, -(q * translation)};
}

Eigen::Vector3d Rigid3d::TargetOriginInSource() const { return -(rotation.conjugate() * translation); }

Rigid3d Rigid3d::Plus(const Vector6d& delta) const {
  return {ExpSO3(delta.head<3>()) * rotation, translation + delta.tail<3>()};
}

Vector6d Rigid3d::Minus(const Rigid3d& other) const {
  Vector6d d;
  d << LogSO3(rotation * other.rotation.conjugate()), translation - other.translation;
  return d;
}

bool Rigid3d::IsFinite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }

Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {c_from_b.rotation * b_from_a.rotation, c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

Matrix6d InverseJacobian(const Rigid3d& b_from_a) {
  const Eigen::Matrix3d rt = b_from_a.rotation.conjugate().toRotationMatrix();
  Matrix6d j = Matrix6d::Zero();
  j.topLeftCorner<3, 3>() = -rt;
  // t_inv = -(Exp(w) R)^T (t + d) = -R^T (I - [w]x)(t + d)  =>  d t_inv = -R^T d - R^T [t]x w
  j.bottomLeftCorner<3, 3>() = -rt * Skew(b_from_a.translation);
  j.bottomRightCorner<3, 3>() = -rt;
  return j;
}

Matrix6d InverseCovariance(const Rigid3d& b_from_a, const Matrix6d& covariance) {
  const Matrix6d j = InverseJacobian(b_from_a);
  return j * covariance * j.transpose();
}

void RelativeJacobians(const Rigid3d& a_from_world, const Rigid3d& b_from_world, Matrix6d* by_a, Matrix6d* by_b) {
  const Eigen::Matrix3d r = (a_from_world.rotation * b_from_world.rotation.conjugate()).toRotationMatrix();
  const Eigen::Vector3d rtb = r * b_from_world.translation;
  by_a->setIdentity();
  by_a->bottomLeftCorner<3, 3>() = Skew(rtb);
  by_b->setZero();
  by_b->topLeftCorner<3, 3>() = -r;
  by_b->bottomLeftCorner<3, 3>() = -Skew(rtb) * r;
  by_b->bottomRightCorner<3, 3>() = -r;
}

Rigid3d Interpolate(const Rigid3d& a, const Rigid3d& b, double s) {
  const Eigen::Vector3d w = LogSO3(b.rotation * a.rotation.conjugate());
  return {ExpSO3(s * w) * a.rotation, (1 - s) * a.translation + s * b.translation};
}

Sim3d Sim3d::Inverse() const {
  const Eigen::Quaterniond q = rotation.conjugate();
  return {1.0 / scale, q, -(q * translation) / scale};
}

Rigid3d Sim3d::TransformPose(const Rigid3d& a_from_x) const {
  return {rotation * a_from_x.rotation, scale * (rotation * a_from_x.translation) + translation};
}

Eigen::Vector3d operator*(const Sim3d& t, const Eigen::Vector3d& p) {
  return t.scale * (t.rotation * p) + t.translation;
}

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {c_from_b.scale * b_from_a.scale, c_from_b.rotation * b_from_a.rotation,
          c_from_b.scale * (c_from_b.rotation * b_from_a.translation) + c_from_b.translation};
}

}  // namespace trigpoint
