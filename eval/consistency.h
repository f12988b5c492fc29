// Is the stated uncertainty real? Normalised errors with their chi-square bounds (Bar-Shalom, Li, Kirubarajan 2001,
// section 5.4.2), alone and with the joint covariance of errors that share a cause.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "eval/bootstrap.h"
#include "eval/results.h"

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

// What the positions of one run have in common: the error of its global fit. The variance of a fit at a place p is a
// quadratic form in (1, x, y); the covariance between places p and q is its polar form, so that the stated sigmas of a
// run's many cameras tell it, axis by axis.
class CommonError {
 public:
  // Least squares over the cameras that state sigmas, made positive semidefinite. Usable() is false with fewer than
  // six of them.
  explicit CommonError(const std::vector<CameraResult>& cameras);
  bool Usable() const { return usable_; }
  // Covariances east, north, up between the common errors at two places of world.
  Eigen::Vector3d Between(const Eigen::Vector3d& p, const Eigen::Vector3d& q) const;

 private:
  bool usable_ = false;
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();
  double scale_ = 1;
  Eigen::Matrix3d form_[3];
};

// e' C^-1 e of all errors at once; unset if the covariance is not positive definite.
std::optional<double> JointNees(const Eigen::VectorXd& errors, const Eigen::MatrixXd& covariance);

}  // namespace trigpoint
