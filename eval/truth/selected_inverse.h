// Blocks of the inverse of a sparse normal matrix without the inverse: Takahashi's equations (Takahashi, Fagan, Chen
// 1973) give all entries on the pattern of the Cholesky factor at about the cost of factorising.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <vector>

namespace trigpoint {

class SelectedInverse {
 public:
  // `normal`: symmetric positive definite, lower triangle stored. Throws NumericError if it is not.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& normal);

  // Entry of the inverse; (row, column) must be on the pattern of `normal` (or of its factor), else std::logic_error.
  double At(int row, int column) const;
  Eigen::MatrixXd Block(int row, int column, int rows, int columns) const;
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& right) const { return llt_.solve(right); }
  // Columns [first, first + count) of the whole inverse, by back-substitution.
  Eigen::MatrixXd Columns(int first, int count) const;

 private:
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> llt_;
  std::vector<int> position_;            // of an unknown in the factor's order
  Eigen::SparseMatrix<double> inverse_;  // lower triangle in that order, pattern of the factor
};

}  // namespace trigpoint
