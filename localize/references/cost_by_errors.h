// How half the cost of a solved bundle problem depends on errors that all observations of some views share.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/estimation/bundle.h"

namespace trigpoint {

// Errors of the views that some poses are seen in: one focal length of theirs, or the places of the views on one rig.
struct SharedErrors {
  bool focal = false;           // a share of the focal length; else rig_from_view of all views, left tangents, 6 each
  Eigen::MatrixXd root;         // covariance = root root^T; one row an error
  std::vector<int> first_view;  // of each pose that has them, index into BundleProblem::views; -1: it has not
};

// First and second derivatives, with the points eliminated.
class CostByErrors {
 public:
  CostByErrors(const SharedErrors& errors, const BundleProblem& p);
  // By all poses (left tangent, 6 rows each) and the errors.
  const Eigen::MatrixXd& mixed() const { return mixed_; }
  // By the errors twice, and once.
  const Eigen::MatrixXd& hessian() const { return hessian_; }
  const Eigen::VectorXd& gradient() const { return gradient_; }

 private:
  int FirstView(size_t k) const;
  void AddPoint(size_t begin, size_t end);
  Eigen::Block<Eigen::MatrixXd, 6> Of(int pose) { return mixed_.middleRows<6>(6 * static_cast<Eigen::Index>(pose)); }

  const SharedErrors& errors_;
  const BundleProblem& p_;
  Eigen::MatrixXd mixed_, hessian_;
  Eigen::VectorXd gradient_;
};

}  // namespace trigpoint
