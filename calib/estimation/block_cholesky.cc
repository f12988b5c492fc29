#include "calib/estimation/block_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <algorithm>

#include "calib/base/wide.h"

namespace trigpoint {
namespace {

constexpr int kDim = 6;

// c(m) -= a(m) * b^T for the blocks m of a column; c(m) at c + 36 * where[m].
TRIGPOINT_WIDE
void SubtractProducts(const double* a, const double* b, double* c, const int* where, int count) {
  for (int m = 0; m < count; ++m) {
    const double* am = a + static_cast<std::ptrdiff_t>(m) * kDim * kDim;
    double* cm = c + static_cast<std::ptrdiff_t>(where[m]) * kDim * kDim;
    for (int q = 0; q < kDim; ++q) {
      double column[kDim];
      for (int i = 0; i < kDim; ++i) column[i] = cm[q * kDim + i];
      for (int p = 0; p < kDim; ++p) {
        const double w = b[p * kDim + q];
        for (int i = 0; i < kDim; ++i) column[i] -= am[p * kDim + i] * w;
      }
      for (int i = 0; i < kDim; ++i) cm[q * kDim + i] = column[i];
    }
  }
}

// What column j of the inverse takes from its column k, z(m) = Z_mk at z + 36 * where[m]:
// c(m) -= z(m) * u_k, and sum -= (sum over m of z(m)^T * u(m))^T, with u_transposed(m) = u(m)^T.
TRIGPOINT_WIDE
void SubtractInverse(const double* z, const int* where, const double* u_k, const double* u_transposed, double* c,
                     double* sum, int count) {
  double total[kDim * kDim];
  for (int i = 0; i < kDim * kDim; ++i) total[i] = sum[i];
  for (int m = 0; m < count; ++m) {
    const double* zm = z + static_cast<std::ptrdiff_t>(where[m]) * kDim * kDim;
    const double* um = u_transposed + static_cast<std::ptrdiff_t>(m) * kDim * kDim;
    double* cm = c + static_cast<std::ptrdiff_t>(m) * kDim * kDim;
    for (int q = 0; q < kDim; ++q) {
      double column[kDim];
      for (int i = 0; i < kDim; ++i) column[i] = cm[q * kDim + i];
      for (int p = 0; p < kDim; ++p) {
        const double w = u_k[q * kDim + p];
        for (int i = 0; i < kDim; ++i) column[i] -= zm[p * kDim + i] * w;
      }
      for (int i = 0; i < kDim; ++i) cm[q * kDim + i] = column[i];
    }
    for (int q = 0; q < kDim; ++q) {
      double column[kDim];
      for (int i = 0; i < kDim; ++i) column[i] = total[q * kDim + i];
      for (int p = 0; p < kDim; ++p) {
        const double w = zm[q * kDim + p];
        for (int i = 0; i < kDim; ++i) column[i] -= um[p * kDim + i] * w;
      }
      for (int i = 0; i < kDim; ++i) total[q * kDim + i] = column[i];
    }
  }
  for (int i = 0; i < kDim * kDim; ++i) sum[i] = total[i];
}

}  // namespace

BlockCholesky::BlockCholesky(int blocks, const std::vector<std::pair<int, int>>& lower) : n_(blocks) {
  std::vector<Eigen::Triplet<double>> triplets;
  for (const auto& [row, column] : lower) {
    triplets.emplace_back(row, column, 1.0);
    if (row != column) triplets.emplace_back(column, row, 1.0);
  }
  Eigen::SparseMatrix<double> graph(n_, n_);
  graph.setFromTriplets(triplets.begin(), triplets.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph, order);
  place_.resize(static_cast<size_t>(n_));
  for (int k = 0; k < n_; ++k) place_[static_cast<size_t>(order.indices()(k))] = k;

  // Rows of each column of the factor: its own and those its children pass on.
  std::vector<std::vector<int>> rows(static_cast<size_t>(n_));
  for (const auto& [row, column] : lower) {
    const int a = place_[static_cast<size_t>(row)], b = place_[static_cast<size_t>(column)];
    if (a != b) rows[static_cast<size_t>(std::min(a, b))].push_back(std::max(a, b));
  }
  start_.assign(static_cast<size_t>(n_) + 1, 0);
  std::vector<std::vector<int>> children(static_cast<size_t>(n_));
  for (int j = 0; j < n_; ++j) {
    std::vector<int>& mine = rows[static_cast<size_t>(j)];
    for (int child : children[static_cast<size_t>(j)]) {
      const std::vector<int>& theirs = rows[static_cast<size_t>(child)];
      mine.insert(mine.end(), theirs.begin() + 1, theirs.end());
    }
    std::sort(mine.begin(), mine.end());
    mine.erase(std::unique(mine.begin(), mine.end()), mine.end());
    if (!mine.empty()) children[static_cast<size_t>(mine.front())].push_back(j);
    start_[static_cast<size_t>(j) + 1] = start_[static_cast<size_t>(j)] + static_cast<int>(mine.size());
  }
  for (const std::vector<int>& mine : rows) rows_.insert(rows_.end(), mine.begin(), mine.end());
  for (const auto& [row, column] : lower) {
    const int a = place_[static_cast<size_t>(row)], b = place_[static_cast<size_t>(column)];
    into_.push_back({a == b ? a : Find(std::max(a, b), std::min(a, b)), a == b, a < b});
  }
}

int BlockCholesky::Find(int row, int column) const {
  const auto begin = rows_.begin() + start_[static_cast<size_t>(column)];
  const auto end = rows_.begin() + start_[static_cast<size_t>(column) + 1];
  const auto it = std::lower_bound(begin, end, row);
  return it != end && *it == row ? static_cast<int>(it - rows_.begin()) : -1;
}

bool BlockCholesky::Factorize(const std::vector<Matrix6d>& values, double damping) {
  diagonal_.resize(static_cast<size_t>(n_));
  below_.assign(rows_.size(), Matrix6d::Zero());
  for (size_t k = 0; k < values.size(); ++k) {
    const Target& t = into_[k];
    if (t.diagonal) {
      Matrix6d& d = diagonal_[static_cast<size_t>(t.place)];
      d = values[k];
      d.diagonal() += damping * values[k].diagonal().cwiseAbs();
    } else if (t.transposed) {
      below_[static_cast<size_t>(t.place)] = values[k].transpose();
    } else {
      below_[static_cast<size_t>(t.place)] = values[k];
    }
  }
  std::vector<int> where;
  for (int j = 0; j < n_; ++j) {
    Matrix6d& d = diagonal_[static_cast<size_t>(j)];
    const Eigen::LLT<Matrix6d, Eigen::Lower> llt(d);
    if (llt.info() != Eigen::Success) return false;
    d = llt.matrixL();
    const int begin = start_[static_cast<size_t>(j)], end = start_[static_cast<size_t>(j) + 1];
    for (int k = begin; k < end; ++k) {
      // L_kj = A_kj L_jj^-T
      below_[static_cast<size_t>(k)] =
          d.triangularView<Eigen::Lower>().solve(below_[static_cast<size_t>(k)].transpose()).transpose().eval();
    }
    // What this column takes from those to its right.
    for (int k = begin; k < end; ++k) {
      const int column = rows_[static_cast<size_t>(k)];
      const Matrix6d& lk = below_[static_cast<size_t>(k)];
      diagonal_[static_cast<size_t>(column)].noalias() -= lk * lk.transpose();
      where.clear();
      int at = start_[static_cast<size_t>(column)];
      for (int m = k + 1; m < end; ++m) {
        while (rows_[static_cast<size_t>(at)] != rows_[static_cast<size_t>(m)]) ++at;
        where.push_back(at);
      }
      if (where.empty()) continue;
      SubtractProducts(below_[static_cast<size_t>(k) + 1].data(), lk.data(), below_[0].data(), where.data(),
                       static_cast<int>(where.size()));
    }
  }
  return true;
}

void BlockCholesky::Solve(Eigen::Ref<Eigen::VectorXd> x) const {
  Eigen::VectorXd y(x.size());
  for (int b = 0; b < n_; ++b) y.segment<kDim>(kDim * place_[static_cast<size_t>(b)]) = x.segment<kDim>(kDim * b);
  for (int j = 0; j < n_; ++j) {
    auto yj = y.segment<kDim>(kDim * j);
    diagonal_[static_cast<size_t>(j)].triangularView<Eigen::Lower>().solveInPlace(yj);
    for (int k = start_[static_cast<size_t>(j)]; k < start_[static_cast<size_t>(j) + 1]; ++k) {
      y.segment<kDim>(kDim * rows_[static_cast<size_t>(k)]).noalias() -= below_[static_cast<size_t>(k)] * yj;
    }
  }
  for (int j = n_ - 1; j >= 0; --j) {
    auto yj = y.segment<kDim>(kDim * j);
    for (int k = start_[static_cast<size_t>(j)]; k < start_[static_cast<size_t>(j) + 1]; ++k) {
      yj.noalias() -=
          below_[static_cast<size_t>(k)].transpose() * y.segment<kDim>(kDim * rows_[static_cast<size_t>(k)]);
    }
    diagonal_[static_cast<size_t>(j)].triangularView<Eigen::Lower>().transpose().solveInPlace(yj);
  }
  for (int b = 0; b < n_; ++b) x.segment<kDim>(kDim * b) = y.segment<kDim>(kDim * place_[static_cast<size_t>(b)]);
}

BlockCholesky::Inverse BlockCholesky::SelectedInverse() const {
  Inverse z;
  z.factor_ = this;
  z.diagonal_.resize(static_cast<size_t>(n_));
  z.below_.assign(rows_.size(), Matrix6d::Zero());
  std::vector<Matrix6d> unit, transposed;  // L_kj L_jj^-1
  std::vector<int> where;
  for (int j = n_ - 1; j >= 0; --j) {
    const int begin = start_[static_cast<size_t>(j)], end = start_[static_cast<size_t>(j) + 1];
    const Matrix6d inverse =
        diagonal_[static_cast<size_t>(j)].triangularView<Eigen::Lower>().solve(Matrix6d::Identity());
    unit.clear();
    transposed.clear();
    for (int k = begin; k < end; ++k) {
      unit.push_back(below_[static_cast<size_t>(k)] * inverse);
      transposed.push_back(unit.back().transpose());
    }
    // Z_ij = - sum_k Z_ik U_kj over the rows k of the column: the pattern is closed under this sum.
    for (int k = begin; k < end; ++k) {
      const int column = rows_[static_cast<size_t>(k)];
      const Matrix6d& u = unit[static_cast<size_t>(k - begin)];
      where.clear();
      int at = start_[static_cast<size_t>(column)];
      for (int m = k + 1; m < end; ++m) {
        while (rows_[static_cast<size_t>(at)] != rows_[static_cast<size_t>(m)]) ++at;
        where.push_back(at);
      }
      Matrix6d own = (z.diagonal_[static_cast<size_t>(column)] * u).transpose() * -1.0;
      if (!where.empty()) {
        SubtractInverse(z.below_[0].data(), where.data(), u.data(),
                        transposed[static_cast<size_t>(k - begin) + 1].data(),
                        z.below_[static_cast<size_t>(k) + 1].data(), own.data(), static_cast<int>(where.size()));
      }
      z.below_[static_cast<size_t>(k)] += own.transpose();
    }
    Matrix6d d = inverse.transpose() * inverse;
    for (int k = begin; k < end; ++k) {
      d.noalias() -= unit[static_cast<size_t>(k - begin)].transpose() * z.below_[static_cast<size_t>(k)];
    }
    z.diagonal_[static_cast<size_t>(j)] = 0.5 * (d + d.transpose());
  }
  return z;
}

Matrix6d BlockCholesky::Inverse::Block(int row, int column) const {
  const int a = factor_->place_[static_cast<size_t>(row)], b = factor_->place_[static_cast<size_t>(column)];
  if (a == b) return diagonal_[static_cast<size_t>(a)];
  const int k = factor_->Find(std::max(a, b), std::min(a, b));
  if (k < 0) return Matrix6d::Zero();
  return a > b ? below_[static_cast<size_t>(k)] : Matrix6d(below_[static_cast<size_t>(k)].transpose());
}

}  // namespace trigpoint
