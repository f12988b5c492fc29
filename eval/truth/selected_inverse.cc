#include "eval/truth/selected_inverse.h"

#include <algorithm>
#include <stdexcept>

#include "calib/base/error.h"

namespace trigpoint {

SelectedInverse::SelectedInverse(const Eigen::SparseMatrix<double>& normal) : llt_(normal) {
  if (llt_.info() != Eigen::Success) {
    throw NumericError("the equations of the poses are singular: something is not tied to the tag map");
  }
  const int n = static_cast<int>(normal.rows());
  position_.resize(n);
  for (int i = 0; i < n; ++i) position_[i] = llt_.permutationP().indices()[i];
  const Eigen::SparseMatrix<double> l = llt_.matrixL();
  inverse_ = l;
  const int* outer = inverse_.outerIndexPtr();
  const int* inner = inverse_.innerIndexPtr();
  double* z = inverse_.valuePtr();
  const double* factor = l.valuePtr();
  std::vector<double> sum;
  std::vector<int> place(n, -1);
  for (int j = n - 1; j >= 0; --j) {
    // Rows of column j below the diagonal; the inverse among them is known already.
    const int begin = outer[j] + 1, end = outer[j + 1], count = end - begin;
    sum.assign(count, 0.0);
    for (int a = 0; a < count; ++a) place[inner[begin + a]] = a;
    for (int a = 0; a < count; ++a) {
      const int k = inner[begin + a];
      const double lk = factor[begin + a];
      for (int e = outer[k]; e < outer[k + 1]; ++e) {
        const int b = place[inner[e]];
        if (b < 0) continue;
        sum[b] += lk * z[e];
        if (b != a) sum[a] += factor[begin + b] * z[e];
      }
    }
    const double inverse_diagonal = 1 / factor[outer[j]];
    double diagonal = inverse_diagonal;
    for (int a = 0; a < count; ++a) {
      z[begin + a] = -inverse_diagonal * sum[a];
      diagonal -= factor[begin + a] * z[begin + a];
    }
    z[outer[j]] = inverse_diagonal * diagonal;
    for (int a = 0; a < count; ++a) place[inner[begin + a]] = -1;
  }
}

double SelectedInverse::At(int row, int column) const {
  const int a = position_[row], b = position_[column], low = std::max(a, b), j = std::min(a, b);
  const int* first = inverse_.innerIndexPtr() + inverse_.outerIndexPtr()[j];
  const int* last = inverse_.innerIndexPtr() + inverse_.outerIndexPtr()[j + 1];
  const int* found = std::lower_bound(first, last, low);
  if (found == last || *found != low) throw std::logic_error("entry of the inverse is off the factor's pattern");
  return inverse_.valuePtr()[found - inverse_.innerIndexPtr()];
}

Eigen::MatrixXd SelectedInverse::Block(int row, int column, int rows, int columns) const {
  Eigen::MatrixXd block(rows, columns);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) block(i, j) = At(row + i, column + j);
  }
  return block;
}

Eigen::MatrixXd SelectedInverse::Columns(int first, int count) const {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(position_.size()), count);
  for (int i = 0; i < count; ++i) right(first + i, i) = 1;
  return llt_.solve(right);
}

}  // namespace trigpoint
