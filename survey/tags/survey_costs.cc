#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

// Derivative by the tangent to derivative by the 7-block, such that the manifold's PlusJacobian gives it back.
template <int kRows>
void ToAmbient(const Eigen::Matrix<double, kRows, 6>& by_tangent, const double* block, double* jacobian) {
  Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
  Rigid3Manifold().MinusJacobian(block, minus.data());
  Eigen::Map<Eigen::Matrix<double, kRows, 7, Eigen::RowMajor>>{jacobian} = by_tangent * minus;
}

}  // namespace

bool TagCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Matrix86d by_body, by_tag;
  const bool wanted = jacobians != nullptr;
  Eigen::Map<Vector8d>{residuals} =
      TagResidual(sight_, size_m_, cam_from_body_, Rigid3FromBlock(parameters[0]), Rigid3FromBlock(parameters[1]),
                  wanted ? &by_body : nullptr, wanted ? &by_tag : nullptr) /
      *scale_;
  if (!wanted) return true;
  if (jacobians[0] != nullptr) ToAmbient<8>(by_body / *scale_, parameters[0], jacobians[0]);
  if (jacobians[1] != nullptr) ToAmbient<8>(by_tag / *scale_, parameters[1], jacobians[1]);
  return true;
}

bool OdometryCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Rigid3d a = Rigid3FromBlock(parameters[0]), b = Rigid3FromBlock(parameters[1]);
  const double s = parameters[2][0], inverse_rot = 1 / (sigma_rot_ * *scale_rot_),
               inverse_m = 1 / (sigma_m_ * *scale_m_);
  const Eigen::Matrix3d at = a.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d step = b.translation - a.translation;
  const Eigen::Vector3d turn = LogSO3(a_from_b_.rotation.conjugate() * a.rotation.conjugate() * b.rotation);
  Eigen::Map<Vector6d> r(residuals);
  r.head<3>() = inverse_rot * turn;
  r.tail<3>() = inverse_m * (at * step - s * a_from_b_.translation);
  if (jacobians == nullptr) return true;
  // Log(E Exp(w)) = Log(E) + Jr^-1 w, Jr^-1(x) = Jl^-1(x)'.
  const Eigen::Matrix3d by_turn =
      inverse_rot * LeftJacobianInverseSO3(turn).transpose() * b.rotation.conjugate().toRotationMatrix();
  Eigen::Matrix<double, 6, 6> j = Eigen::Matrix<double, 6, 6>::Zero();
  if (jacobians[0] != nullptr) {
    j.topLeftCorner<3, 3>() = -by_turn;
    j.bottomLeftCorner<3, 3>() = inverse_m * at * Skew(step);
    j.bottomRightCorner<3, 3>() = -inverse_m * at;
    ToAmbient<6>(j, parameters[0], jacobians[0]);
  }
  if (jacobians[1] != nullptr) {
    j.setZero();
    j.topLeftCorner<3, 3>() = by_turn;
    j.bottomRightCorner<3, 3>() = inverse_m * at;
    ToAmbient<6>(j, parameters[1], jacobians[1]);
  }
  if (jacobians[2] != nullptr) {
    Eigen::Map<Vector6d> by_scale(jacobians[2]);
    by_scale.setZero();
    by_scale.tail<3>() = -inverse_m * a_from_b_.translation;
  }
  return true;
}

bool PointCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Rigid3d pose = Rigid3FromBlock(parameters[0]);
  const Eigen::Vector3d turned = pose.rotation * lever_;
  Eigen::Map<Eigen::Vector3d>{residuals} = inverse_sigma_.cwiseProduct(turned + pose.translation - wanted_);
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Matrix<double, 3, 6> j;
  j << -Skew(turned), Eigen::Matrix3d::Identity();
  ToAmbient<3>(inverse_sigma_.asDiagonal() * j, parameters[0], jacobians[0]);
  return true;
}

bool DistanceCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Vector3d d = Rigid3FromBlock(parameters[1]).translation - Rigid3FromBlock(parameters[0]).translation;
  const double length = d.norm();
  if (length < 1e-9) return false;
  residuals[0] = (length - distance_m_) / sigma_m_;
  if (jacobians == nullptr) return true;
  Eigen::Matrix<double, 1, 6> j = Eigen::Matrix<double, 1, 6>::Zero();
  j.tail<3>() = d.transpose() / (length * sigma_m_);
  if (jacobians[0] != nullptr) ToAmbient<1>(-j, parameters[0], jacobians[0]);
  if (jacobians[1] != nullptr) ToAmbient<1>(j, parameters[1], jacobians[1]);
  return true;
}

bool NumberCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  residuals[0] = (parameters[0][0] - mean_) / sigma_;
  if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1 / sigma_;
  return true;
}

}  // namespace trigpoint
