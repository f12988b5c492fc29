#include "eval/consistency.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>

#include "eval/distributions.h"

namespace trigpoint {
namespace {

constexpr size_t kTerms = 6;  // of a quadratic form in (1, x, y)

Eigen::Vector3d Place(const Eigen::Vector3d& p, const Eigen::Vector2d& centre, double scale) {
  return {1, (p.x() - centre.x()) / scale, (p.y() - centre.y()) / scale};
}

}  // namespace

Interval NeesSummary::Bounds(double confidence) const {
  if (dof < 1) return {};
  const double tail = 0.5 * (1 - confidence);
  return {ChiSquareQuantile(tail, dof) / dof, ChiSquareQuantile(1 - tail, dof) / dof};
}

bool NeesSummary::Inside(double confidence) const {
  const Interval bounds = Bounds(confidence);
  return dof > 0 && PerDof() >= bounds.low && PerDof() <= bounds.high;
}

CommonError::CommonError(const std::vector<CameraResult>& cameras) {
  std::vector<const CameraResult*> used;
  for (const CameraResult& camera : cameras) {
    if (camera.world_from_cam && camera.sigma_m) used.push_back(&camera);
  }
  if (used.size() < kTerms) return;
  for (const CameraResult* c : used) centre_ += c->world_from_cam->translation.head<2>();
  centre_ /= static_cast<double>(used.size());
  double squares = 0;
  for (const CameraResult* c : used) squares += (c->world_from_cam->translation.head<2>() - centre_).squaredNorm();
  scale_ = std::max(1e-3, std::sqrt(squares / static_cast<double>(used.size())));
  const auto n = static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd a(n, kTerms);
  Eigen::MatrixXd variance(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const CameraResult& c = *used[static_cast<size_t>(i)];
    const Eigen::Vector3d f = Place(c.world_from_cam->translation, centre_, scale_);
    a.row(i) << 1, 2 * f.y(), 2 * f.z(), f.y() * f.y(), 2 * f.y() * f.z(), f.z() * f.z();
    variance.row(i) = c.sigma_m->cwiseAbs2().transpose();
  }
  // The least-norm solution where the path is a straight line or a point.
  const Eigen::MatrixXd m = a.completeOrthogonalDecomposition().solve(variance);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::VectorXd v = m.col(axis);
    Eigen::Matrix3d form;
    form << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(form);
    form_[axis] =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
  }
  usable_ = true;
}

Eigen::Vector3d CommonError::Between(const Eigen::Vector3d& p, const Eigen::Vector3d& q) const {
  const Eigen::Vector3d f = Place(p, centre_, scale_), g = Place(q, centre_, scale_);
  return {f.dot(form_[0] * g), f.dot(form_[1] * g), f.dot(form_[2] * g)};
}

std::optional<double> JointNees(const Eigen::VectorXd& errors, const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  if (llt.info() != Eigen::Success) return std::nullopt;
  return errors.dot(llt.solve(errors));
}

}  // namespace trigpoint
