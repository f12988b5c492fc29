// Sparse Cholesky factorisation of a symmetric positive definite matrix of 6 x 6 blocks: the reduced system of a bundle
// adjustment, a block for each pose. For a run without loops cost and memory grow linearly with its length; where loops
// tie everything together it is a dense factorisation at the speed of one.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

class BlockCholesky {
 public:
  // `blocks` blocks a side; `lower`: the (row, column) of every block that may not be zero, row >= column, each once,
  // the diagonal included. The elimination order is chosen here (approximate minimum degree).
  BlockCholesky(int blocks, const std::vector<std::pair<int, int>>& lower);

  // The matrix is gathered where its factor will be, as there may not be room for both: all zero, then a b^T (`depth`
  // columns of 6 each) is added to the block of `lower` with that index. Blocks of different indices may be added to by
  // different threads.
  void SetZero() { factor_.assign(size_, 0); }
  void Add(int index, const double* a, const double* b, int depth);
  template <int kColumns>
  void Add(int index, const Eigen::Matrix<double, 6, kColumns>& a, const Eigen::Matrix<double, 6, kColumns>& b) {
    Add(index, a.data(), b.data(), kColumns);
  }
  // The diagonal of the block of `lower` with that index, which is a diagonal one.
  using Diagonal6 = Eigen::Map<Vector6d, 0, Eigen::InnerStride<>>;
  Diagonal6 Diagonal(int index) {
    const Target& t = into_[static_cast<size_t>(index)];
    return Diagonal6(factor_.data() + t.at, Eigen::InnerStride<>(t.stride + 1));
  }
  // Of diagonal blocks the lower triangle is read. `damping` is a part of each diagonal element that is added to it.
  // False if the matrix is not positive definite. The result does not depend on the number of threads.
  bool Factorize(double damping, int threads = 1);
  // x <- A^-1 x; 6 * blocks rows.
  void Solve(Eigen::Ref<Eigen::VectorXd> x) const;

  // The blocks of A^-1 inside the pattern of the factor, by selected inversion (Takahashi et al. 1973): all pairs that
  // `lower` names are among them. Rests on the factor's pattern: valid while this object lives.
  class Inverse {
   public:
    // Zero outside the factor's pattern.
    Matrix6d Block(int row, int column) const;

   private:
    friend class BlockCholesky;
    const BlockCholesky* factor_ = nullptr;
    std::vector<double> values_;  // laid out as the factor's
  };
  Inverse SelectedInverse(int threads = 1) const&;
  // In the factor's own memory: until the next Factorize there is nothing left to solve with.
  Inverse SelectedInverse(int threads = 1) &&;

 private:
  struct Target {
    size_t at;  // in factor_
    Eigen::Index stride;
    bool diagonal;
    bool transposed;  // the value's block lies above the diagonal in elimination order
  };
  // Neighbouring columns (in elimination order) of about the same pattern, stored as one dense matrix, column by
  // column: a square whose lower triangle counts, and the rows below that any of them has.
  struct Supernode {
    int first = 0, width = 0;  // columns [first, first + width)
    int begin = 0, rows = 0;   // rows_[begin, begin + rows)
    size_t values = 0;         // where its values begin
    Eigen::Index Stride() const { return 6 * static_cast<Eigen::Index>(width + rows); }
    int end() const { return first + width; }
  };
  // The rows of a supernode that are columns of another one, which it updates: its rows [from, to), and the index in
  // that one of each of its rows from `from` on.
  struct SupernodeUpdate {
    const Supernode* other = nullptr;
    int from = 0, to = 0;
    std::vector<int> where;
  };
  std::vector<SupernodeUpdate> UpdatesOf(const Supernode& supernode) const;
  // The factor's values in, those of the inverse out.
  Inverse Invert(std::vector<double> factor, int threads) const;
  // Threads are begun for what takes longer than they do.
  int ThreadsFor(const Supernode& supernode, int threads) const;
  // Where the block at (row, column) begins, both in elimination order and row >= column; kNowhere: it is zero.
  static constexpr size_t kNowhere = static_cast<size_t>(-1);
  size_t Find(int row, int column) const;
  const Supernode& SupernodeOf(int column) const {
    return supernodes_[static_cast<size_t>(supernode_of_[static_cast<size_t>(column)])];
  }

  int n_ = 0;
  std::vector<int> position_;  // of each block in the elimination order
  std::vector<Supernode> supernodes_;
  std::vector<int> supernode_of_;  // of each column
  std::vector<int> rows_;          // ascending within a supernode, in elimination order
  std::vector<Target> into_;       // of each value
  size_t size_ = 0;
  std::vector<double> factor_;
};

}  // namespace trigpoint
