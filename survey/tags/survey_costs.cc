#include "survey/tags/survey_costs.h"

#include <cmath>

#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

constexpr double kOutOfSight = 300;  // residual of a corner that the camera cannot see, sigmas

}  // namespace

Vector6d OdometryStepSigma(double length_m, double seconds, double rotation_deg, double translation_m) {
  const double root = std::sqrt(length_m + 0.01 * seconds + 1e-6);
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(rotation_deg * kDegToRad * root), Eigen::Vector3d::Constant(translation_m * root);
  return sigma;
}

bool TagCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Matrix86d by_body, by_tag;
  const bool wanted = jacobians != nullptr;
  const double shift = parameters[2][0];
  Eigen::Map<Vector8d>{residuals} =
      (TagResidual(sight_, size_m_, cam_from_body_, Rigid3FromBlock(parameters[0]), Rigid3FromBlock(parameters[1]),
                   wanted ? &by_body : nullptr, wanted ? &by_tag : nullptr) -
       shift * sight_.outward) /
      *scale_;
  if (!wanted) return true;
  if (jacobians[0] != nullptr) ToAmbient(by_body / *scale_, parameters[0], jacobians[0]);
  if (jacobians[1] != nullptr) ToAmbient(by_tag / *scale_, parameters[1], jacobians[1]);
  if (jacobians[2] != nullptr) Eigen::Map<Vector8d>{jacobians[2]} = -sight_.outward / *scale_;
  return true;
}

Camera AdjustedCamera(const Camera& camera, const double* change) {
  std::vector<double> p = camera.params();
  CameraModel model = camera.model();
  if (model == CameraModel::kPinhole) {
    model = CameraModel::kRadtan;
    p.resize(8, 0.0);
  }
  p[0] *= std::exp(change[0]);
  p[1] *= std::exp(change[0]);
  for (size_t k = 2; k < 6; ++k) p[k] += change[k - 1];
  return Camera(model, camera.width(), camera.height(), p);
}

bool TagPixelCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Rigid3d body = Rigid3FromBlock(parameters[0]), tag = Rigid3FromBlock(parameters[1]);
  const Eigen::Matrix3d cam_from_world = (cam_from_body_.rotation * body.rotation.conjugate()).toRotationMatrix();
  Matrix86d by_body = Matrix86d::Zero(), by_tag = Matrix86d::Zero();
  const auto project = [&](const Camera& camera, Vector8d* r, bool with_jacobian) {
    for (size_t k = 0; k < 4; ++k) {
      const double weight = 1 / (sigma_px_[k] * *scale_);
      const Eigen::Vector3d lever = tag.rotation * TagCorner(size_m_, static_cast<int>(k));
      const Eigen::Vector3d d = lever + tag.translation - body.translation;
      const Eigen::Vector3d point = cam_from_world * d + cam_from_body_.translation;
      Eigen::Matrix<double, 2, 3> by_point = Eigen::Matrix<double, 2, 3>::Zero();
      const auto pixel = camera.Project(point, &by_point);
      if (!pixel) return false;
      const auto row = static_cast<Eigen::Index>(2 * k);
      r->segment<2>(row) = weight * (*pixel - corners_[k]);
      if (!with_jacobian) continue;
      by_point = weight * by_point * cam_from_world;
      by_tag.block<2, 3>(row, 0) = -by_point * Skew(lever);
      by_tag.block<2, 3>(row, 3) = by_point;
      by_body.block<2, 3>(row, 0) = by_point * Skew(d);
      by_body.block<2, 3>(row, 3) = -by_point;
    }
    return true;
  };
  Vector8d r = Vector8d::Zero();
  if (!project(AdjustedCamera(camera_, parameters[2]), &r, jacobians != nullptr)) {
    // Outside what the camera sees: far off, and nothing to follow.
    r.setConstant(kOutOfSight);
    by_body.setZero();
    by_tag.setZero();
  }
  Eigen::Map<Vector8d>{residuals} = r;
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) ToAmbient(by_body, parameters[0], jacobians[0]);
  if (jacobians[1] != nullptr) ToAmbient(by_tag, parameters[1], jacobians[1]);
  if (jacobians[2] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 8, kCameraNumbers, Eigen::RowMajor>> j(jacobians[2]);
    constexpr double kStep[kCameraNumbers] = {1e-6, 1e-3, 1e-3, 1e-6, 1e-6};
    for (int k = 0; k < kCameraNumbers; ++k) {
      std::array<double, kCameraNumbers> moved{};
      std::copy(parameters[2], parameters[2] + kCameraNumbers, moved.begin());
      Vector8d plus = r, minus = r;
      moved[static_cast<size_t>(k)] += kStep[k];
      bool seen = r[0] != kOutOfSight && project(AdjustedCamera(camera_, moved.data()), &plus, false);
      moved[static_cast<size_t>(k)] -= 2 * kStep[k];
      seen = seen && project(AdjustedCamera(camera_, moved.data()), &minus, false);
      j.col(k) = seen ? Vector8d((plus - minus) / (2 * kStep[k])) : Vector8d(Vector8d::Zero());
    }
  }
  return true;
}

bool OdometryCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Rigid3d a = Rigid3FromBlock(parameters[0]), b = Rigid3FromBlock(parameters[1]);
  const double s = parameters[2][0], drift = parameters[3][0];
  const Vector6d inverse = sigma_.cwiseProduct(Eigen::Map<const Vector6d>(factor_)).cwiseInverse();
  const auto inverse_rot = inverse.head<3>().asDiagonal();
  const auto inverse_m = inverse.tail<3>().asDiagonal();
  const Eigen::Matrix3d at = a.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d step = b.translation - a.translation;
  const Eigen::Vector3d turn = LogSO3(a_from_b_.rotation.conjugate() * a.rotation.conjugate() * b.rotation);
  const Eigen::Vector3d& turned = way_;
  Eigen::Map<Vector6d> r(residuals);
  r.head<3>() = inverse_rot * (turn - drift * turned);
  r.tail<3>() = inverse_m * (at * step / s - a_from_b_.translation);
  if (jacobians == nullptr) return true;
  // Log(E Exp(w)) = Log(E) + Jr^-1 w, Jr^-1(x) = Jl^-1(x)'.
  const Eigen::Matrix3d by_turn =
      inverse_rot * (LeftJacobianInverseSO3(turn).transpose() * b.rotation.conjugate().toRotationMatrix());
  Eigen::Matrix<double, 6, 6> j = Eigen::Matrix<double, 6, 6>::Zero();
  if (jacobians[0] != nullptr) {
    j.topLeftCorner<3, 3>() = -by_turn;
    j.bottomLeftCorner<3, 3>() = inverse_m * (at * Skew(step)) / s;
    j.bottomRightCorner<3, 3>() = -(inverse_m * at) / s;
    ToAmbient(j, parameters[0], jacobians[0]);
  }
  if (jacobians[1] != nullptr) {
    j.setZero();
    j.topLeftCorner<3, 3>() = by_turn;
    j.bottomRightCorner<3, 3>() = inverse_m * at / s;
    ToAmbient(j, parameters[1], jacobians[1]);
  }
  if (jacobians[2] != nullptr) {
    Eigen::Map<Vector6d> by_scale(jacobians[2]);
    by_scale.setZero();
    by_scale.tail<3>() = -(inverse_m * (at * step)) / (s * s);
  }
  if (jacobians[3] != nullptr) {
    Eigen::Map<Vector6d> by_drift(jacobians[3]);
    by_drift.setZero();
    by_drift.head<3>() = -(inverse_rot * turned);
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
  ToAmbient(inverse_sigma_.asDiagonal() * j, parameters[0], jacobians[0]);
  return true;
}

bool ShiftedPointCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  point_.Evaluate(parameters, residuals, jacobians);
  const Eigen::Map<const Eigen::Vector3d> shift(parameters[1]);
  Eigen::Map<Eigen::Vector3d>{residuals} += inverse_sigma_.cwiseProduct(shift);
  if (jacobians != nullptr && jacobians[1] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{jacobians[1]} = inverse_sigma_.asDiagonal();
  }
  return true;
}

bool PosePriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Vector6d difference = Rigid3FromBlock(parameters[0]).Minus(known_);
  Eigen::Map<Vector6d>{residuals} = inverse_sigma_.cwiseProduct(difference);
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Matrix<double, 6, 6> j = Eigen::Matrix<double, 6, 6>::Identity();
  j.topLeftCorner<3, 3>() = LeftJacobianInverseSO3(difference.head<3>());
  ToAmbient(inverse_sigma_.asDiagonal() * j, parameters[0], jacobians[0]);
  return true;
}

bool GravityCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Matrix3d body_from_world = Rigid3FromBlock(parameters[0]).rotation.conjugate().toRotationMatrix();
  Eigen::Map<Eigen::Vector3d>{residuals} = (body_from_world.col(2) - up_) / sigma_;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Matrix<double, 3, 6> j = Eigen::Matrix<double, 3, 6>::Zero();
  j.leftCols<3>() = body_from_world * Skew(Eigen::Vector3d::UnitZ()) / sigma_;
  ToAmbient(j, parameters[0], jacobians[0]);
  return true;
}

bool HeightCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  residuals[0] = (Rigid3FromBlock(parameters[0]).translation.z() - height_m_) / sigma_m_;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Matrix<double, 1, 6> j = Eigen::Matrix<double, 1, 6>::Zero();
  j(5) = 1 / sigma_m_;
  ToAmbient(j, parameters[0], jacobians[0]);
  return true;
}

bool MarkCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Rigid3d body = Rigid3FromBlock(parameters[0]);
  const Eigen::Vector3d d = Eigen::Map<const Eigen::Vector3d>(parameters[1]) - body.translation;
  const Eigen::Matrix3d cam_from_world = (cam_from_body_.rotation * body.rotation.conjugate()).toRotationMatrix();
  const Eigen::Vector3d p = cam_from_world * d + cam_from_body_.translation;
  const double distance = std::max(p.norm(), 1e-12);
  const Eigen::Vector3d ray = p / distance;
  Eigen::Map<Eigen::Vector2d>{residuals} = w_ * ray;
  if (jacobians == nullptr) return true;
  const Eigen::Matrix<double, 2, 3> by_point =
      w_ * (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / distance * cam_from_world;
  if (jacobians[0] != nullptr) {
    Eigen::Matrix<double, 2, 6> j;
    j << by_point * Skew(d), -by_point;
    ToAmbient(j, parameters[0], jacobians[0]);
  }
  if (jacobians[1] != nullptr) Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobians[1]} = by_point;
  return true;
}

bool KnownPointCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  Eigen::Map<Eigen::Vector3d>{residuals} =
      inverse_sigma_.cwiseProduct(Eigen::Map<const Eigen::Vector3d>(parameters[0]) - point_);
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{jacobians[0]} = inverse_sigma_.asDiagonal();
  }
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
  if (jacobians[0] != nullptr) ToAmbient(-j, parameters[0], jacobians[0]);
  if (jacobians[1] != nullptr) ToAmbient(j, parameters[1], jacobians[1]);
  return true;
}

bool FactorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  if (parameters[0][0] <= 0) return false;
  residuals[0] = std::log(parameters[0][0]) / log_sigma_;
  if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1 / (parameters[0][0] * log_sigma_);
  return true;
}

bool NumberCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  residuals[0] = (parameters[0][0] - mean_) / sigma_;
  if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1 / sigma_;
  return true;
}

}  // namespace trigpoint
