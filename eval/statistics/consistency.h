// Is the stated uncertainty real? Normalised errors with their chi-square bounds (Bar-Shalom, Li, Kirubarajan 2001,
// section 5.4.2), alone and with the joint covariance of errors that share a cause.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// Sum of normalised squared errors of a number of rows.
struct NeesSummary {
  int rows = 0;
  int dof = 0;
  double nees = 0;
  void Add(double value, int degrees) { ++rows, nees += value, dof += degrees; }
  double PerDof() const { return dof > 0 ? nees / dof : 0; }
  // Where PerDof lies with this confidence if every sigma is right (and rows are independent, or `nees` is joint).
  Interval Bounds(double confidence) const;
  bool Inside(double confidence) const;
};

// e' C^-1 e of all errors at once; unset if the covariance is not positive definite.
std::optional<double> JointNees(const Eigen::VectorXd& errors, const Eigen::MatrixXd& covariance);

}  // namespace trigpoint
