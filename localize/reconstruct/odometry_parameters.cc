#include "localize/reconstruct/odometry_parameters.h"

#include <Eigen/Cholesky>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

using ByParameters = Eigen::Matrix<double, 6, Eigen::Dynamic>;

ByParameters Derivative(const ParameterResidual& residual, const PoseFactor& f, Eigen::Index parameters) {
  constexpr double kStep = 1e-5;
  ByParameters j(6, parameters);
  for (Eigen::Index k = 0; k < parameters; ++k) {
    const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(parameters, k);
    j.col(k) = (residual(f, step) - residual(f, -step)) / (2 * kStep);
  }
  return j;
}

}  // namespace

OdometryParameters::OdometryParameters(const BundleProblem& p, const ParameterResidual& residual,
                                       const Eigen::VectorXd& sigmas, int threads, const CancelToken& cancel)
    : normal_(sigmas.cwiseAbs2().cwiseInverse().asDiagonal()), right_(Eigen::VectorXd::Zero(sigmas.size())) {
  const Eigen::Index n = sigmas.size();
  Eigen::MatrixXd by_poses = Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), n);
  for (const PoseFactor& f : p.factors) {
    if (f.kind != PoseFactor::Kind::kBetween) continue;
    const ByParameters j = Derivative(residual, f, n);
    const Vector6d e = residual(f, Eigen::VectorXd::Zero(n));
    Matrix6d ja, jb;
    RelativeJacobians(p.poses[static_cast<size_t>(f.a)], p.poses[static_cast<size_t>(f.b)], &ja, &jb);
    normal_ += f.weight * j.transpose() * j;
    right_ -= f.weight * j.transpose() * e;
    by_poses.middleRows<6>(6 * f.a) += f.weight * (f.sqrt_info * ja).transpose() * j;
    by_poses.middleRows<6>(6 * f.b) += f.weight * (f.sqrt_info * jb).transpose() * j;
  }
  const BundleCovariance covariance(p, threads, cancel);
  const Eigen::MatrixXd moved = covariance.Times(by_poses);
  normal_ -= by_poses.transpose() * moved;
  right_ += moved.transpose() * covariance.Gradient();
}

ParameterEstimate OdometryParameters::Estimate(const std::vector<Eigen::Index>& some) const {
  const auto n = static_cast<Eigen::Index>(some.size());
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(normal_(some, some));
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) {
    throw NumericError("the reconstruction does not determine parameters of its odometry");
  }
  return {ldlt.solve(right_(some)), ldlt.solve(Eigen::MatrixXd::Identity(n, n))};
}

}  // namespace trigpoint
