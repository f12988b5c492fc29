// Sparse Cholesky factorisation of a symmetric positive definite matrix of 6 x 6 blocks: the reduced system of a
// bundle adjustment, a block for each pose. Whole blocks are what makes it several times faster than a scalar sparse
// factorisation; for a run without loops cost and memory grow linearly with its length.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

class BlockCholesky {
 public:
  // `blocks` blocks a side; `lower`: the (row, column) of every block that may not be zero, row >= column, each once,
  // the diagonal included. The elimination order is chosen here (approximate minimum degree).
  BlockCholesky(int blocks, const std::vector<std::pair<int, int>>& lower);

  // The values of `lower`, in its order; of diagonal blocks the lower triangle is read. `damping` is a part of each
  // diagonal element that is added to it. False if the matrix is not positive definite.
  bool Factorize(const std::vector<Matrix6d>& values, double damping);
  // x <- A^-1 x; 6 * blocks rows.
  void Solve(Eigen::Ref<Eigen::VectorXd> x) const;

  // The blocks of A^-1 inside the pattern of the factor, by selected inversion (Takahashi et al. 1973): all pairs that
  // `lower` names are among them. Rests on the factor: valid until the next Factorize.
  class Inverse {
   public:
    // Zero outside the factor's pattern.
    Matrix6d Block(int row, int column) const;

   private:
    friend class BlockCholesky;
    const BlockCholesky* factor_ = nullptr;
    std::vector<Matrix6d> diagonal_, below_;
  };
  Inverse SelectedInverse() const;

 private:
  // Position of row `row` among the blocks below the diagonal of column `column` (both in elimination order), -1: none.
  int Find(int row, int column) const;

  int n_ = 0;
  std::vector<int> place_;  // block -> its turn in the elimination
  std::vector<int> start_;  // blocks below the diagonal of column j: [start_[j], start_[j + 1])
  std::vector<int> rows_;   // their rows, ascending, in elimination order
  struct Target {
    int place;  // in below_, or in diagonal_
    bool diagonal;
    bool transposed;  // the value's block lies above the diagonal in elimination order
  };
  std::vector<Target> into_;                // of each value
  std::vector<Matrix6d> diagonal_, below_;  // the factor L
};

}  // namespace trigpoint
