#include "eval/statistics/consistency.h"

#include <Eigen/Cholesky>

#include "eval/statistics/distributions.h"

namespace trigpoint {

Interval NeesSummary::Bounds(double confidence) const {
  if (dof < 1) return {};
  const double tail = 0.5 * (1 - confidence);
  return {ChiSquareQuantile(tail, dof) / dof, ChiSquareQuantile(1 - tail, dof) / dof};
}

bool NeesSummary::Inside(double confidence) const {
  const Interval bounds = Bounds(confidence);
  return dof > 0 && PerDof() >= bounds.low && PerDof() <= bounds.high;
}

std::optional<double> JointNees(const Eigen::VectorXd& errors, const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  if (llt.info() != Eigen::Success) return std::nullopt;
  return errors.dot(llt.solve(errors));
}

}  // namespace trigpoint
