#include "calib/estimation/block_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cstring>
#include <utility>

#include "calib/base/parallel.h"
#include "calib/base/wide.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace trigpoint {
namespace {

using Eigen::Index;
using Strided = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstStrided = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

constexpr int kDim = 6;
constexpr int kMostColumns = 16;          // blocks in a supernode: what is multiplied at once stays in the cache
constexpr double kMostZeros = 0.15;       // of a supernode's blocks may be zeros that make it one
constexpr int64_t kWorthThreads = 40000;  // products of blocks
constexpr int kTileRows = 2 * kDim;
constexpr int kTileColumns = kDim / 2;

void SubtractColumn(const double* sum, double* const c[2], std::ptrdiff_t at) {
  for (int row = 0; row < 2 && c[row] != nullptr; ++row) {
    for (int i = 0; i < kDim; ++i) c[row][at + i] -= sum[row * kDim + i];
  }
}

// C -= A B for two rows of blocks of C: for every group g of three columns, with A's rows packed as [depth][12] and B
// as [group][depth][3]. Row i of C begins at c[i] (null: it is not wanted), its columns of group g at[g] further on,
// one `stride` apart.
#if defined(__x86_64__)
__attribute__((target("avx2,fma"))) void SubtractTilesWide(const double* a, const double* b, int depth, int groups,
                                                           double* const c[2], const std::ptrdiff_t* at,
                                                           std::ptrdiff_t stride) {
  for (int g = 0; g < groups; ++g) {
    const double* ak = a;
    const double* bk = b + static_cast<std::ptrdiff_t>(g) * depth * kTileColumns;
    __m256d s[kTileColumns][3];
    for (auto& column : s) column[0] = column[1] = column[2] = _mm256_setzero_pd();
    for (int k = 0; k < depth; ++k, ak += kTileRows, bk += kTileColumns) {
      const __m256d a0 = _mm256_loadu_pd(ak), a1 = _mm256_loadu_pd(ak + 4), a2 = _mm256_loadu_pd(ak + 8);
      for (int q = 0; q < kTileColumns; ++q) {
        const __m256d w = _mm256_broadcast_sd(bk + q);
        s[q][0] = _mm256_fmadd_pd(a0, w, s[q][0]);
        s[q][1] = _mm256_fmadd_pd(a1, w, s[q][1]);
        s[q][2] = _mm256_fmadd_pd(a2, w, s[q][2]);
      }
    }
    for (int q = 0; q < kTileColumns; ++q) {
      alignas(32) double sum[kTileRows];
      for (int i = 0; i < 3; ++i) _mm256_store_pd(sum + 4 * i, s[q][i]);
      SubtractColumn(sum, c, at[g] + q * stride);
    }
  }
}
#endif

void SubtractTiles(const double* a, const double* b, int depth, int groups, double* const c[2],
                   const std::ptrdiff_t* at, std::ptrdiff_t stride) {
#if defined(__x86_64__)
  static const bool kWide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (kWide) return SubtractTilesWide(a, b, depth, groups, c, at, stride);
#endif
  for (int g = 0; g < groups; ++g) {
    const double* ak = a;
    const double* bk = b + static_cast<std::ptrdiff_t>(g) * depth * kTileColumns;
    double sum[kTileColumns][kTileRows] = {};
    for (int k = 0; k < depth; ++k, ak += kTileRows, bk += kTileColumns) {
      for (int q = 0; q < kTileColumns; ++q) {
        for (int i = 0; i < kTileRows; ++i) sum[q][i] += ak[i] * bk[q];
      }
    }
    for (int q = 0; q < kTileColumns; ++q) SubtractColumn(sum[q], c, at[g] + q * stride);
  }
}

// C += A B^T, 6 x 6, its columns one `stride` apart; A and B are `depth` columns of 6.
TRIGPOINT_WIDE
void AddProduct(double* c, Index stride, const double* a, const double* b, int depth) {
  using Four = double __attribute__((vector_size(32)));
  using Two = double __attribute__((vector_size(16)));
  for (int q = 0; q < kDim; ++q, c += stride) {
    Four upper, upper_a;
    Two lower, lower_a;
    std::memcpy(&upper, c, sizeof upper);
    std::memcpy(&lower, c + 4, sizeof lower);
    for (int k = 0; k < depth; ++k) {
      std::memcpy(&upper_a, a + k * kDim, sizeof upper);
      std::memcpy(&lower_a, a + k * kDim + 4, sizeof lower);
      upper += upper_a * b[k * kDim + q];
      lower += lower_a * b[k * kDim + q];
    }
    std::memcpy(c, &upper, sizeof upper);
    std::memcpy(c + 4, &lower, sizeof lower);
  }
}

// A matrix of blocks of 6 x 6, packed as the right factor of SubtractTiles. Element (i, q) of its row k of blocks is
// block(k)[stride_i * i + stride_q * q], with 3 * groups columns.
class PackedRight {
 public:
  template <typename Block>
  PackedRight(int depth, int groups, Index stride_i, Index stride_q, Block&& block)
      : depth_(depth), groups_(groups), values_(static_cast<size_t>(kDim * depth * groups * kTileColumns)) {
    double* to = values_.data();
    for (int g = 0; g < groups; ++g) {
      for (int k = 0; k < depth; ++k) {
        const double* from = block(k) + stride_q * g * kTileColumns;
        for (int i = 0; i < kDim; ++i) {
          for (int q = 0; q < kTileColumns; ++q) *to++ = from[stride_i * i + stride_q * q];
        }
      }
    }
  }

  // C -= A B for rows [0, rows) of blocks. Element (p, q) of A's block (i, k) is a(i, k)[stride_p * p + stride_q * q];
  // row i of C begins at c(i), its groups of three columns at[g] further on, one `stride_c` apart.
  template <typename BlockA, typename RowC>
  void SubtractProduct(int rows, Index stride_p, Index stride_q, BlockA&& a, RowC&& c, const std::ptrdiff_t* at,
                       Index stride_c) const {
    std::vector<double> packed(static_cast<size_t>(kDim * depth_ * kTileRows));
    for (int i = 0; i < rows; i += 2) {
      for (int half = 0; half < 2; ++half) {
        for (int k = 0; k < depth_; ++k) {
          const double* from = a(std::min(i + half, rows - 1), k);
          double* to = packed.data() + static_cast<Index>(k) * kDim * kTileRows + half * kDim;
          for (int q = 0; q < kDim; ++q) {
            for (int p = 0; p < kDim; ++p) to[q * kTileRows + p] = from[stride_p * p + stride_q * q];
          }
        }
      }
      double* const two[2] = {c(i), i + 1 < rows ? c(i + 1) : nullptr};
      SubtractTiles(packed.data(), values_.data(), kDim * depth_, groups_, two, at, stride_c);
    }
  }

 private:
  int depth_, groups_;
  std::vector<double> values_;
};

// The groups of three columns that belong to block columns.
void AppendGroups(Index column, Index stride, std::vector<std::ptrdiff_t>* at) {
  at->push_back(kDim * column * stride);
  at->push_back((kDim * column + kTileColumns) * stride);
}

// Each block's position in the elimination order: approximate minimum degree.
std::vector<int> EliminationOrder(int blocks, const std::vector<std::pair<int, int>>& lower) {
  std::vector<Eigen::Triplet<char>> triplets;
  triplets.reserve(lower.size());
  for (const auto& [row, column] : lower) triplets.emplace_back(row, column, 1);
  Eigen::SparseMatrix<char> graph(blocks, blocks);
  graph.setFromTriplets(triplets.begin(), triplets.end());
  triplets = {};
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph.selfadjointView<Eigen::Lower>(), order);
  std::vector<int> position(static_cast<size_t>(blocks));
  for (int k = 0; k < blocks; ++k) position[static_cast<size_t>(order.indices()(k))] = k;
  return position;
}

}  // namespace

BlockCholesky::BlockCholesky(int blocks, const std::vector<std::pair<int, int>>& lower)
    : n_(blocks), position_(EliminationOrder(blocks, lower)) {
  // Rows of each column of the factor: its own and those its children pass on.
  std::vector<std::vector<int>> rows(static_cast<size_t>(n_));
  for (const auto& [row, column] : lower) {
    const int a = position_[static_cast<size_t>(row)], b = position_[static_cast<size_t>(column)];
    if (a != b) rows[static_cast<size_t>(std::min(a, b))].push_back(std::max(a, b));
  }
  std::vector<std::vector<int>> children(static_cast<size_t>(n_));
  supernode_of_.resize(static_cast<size_t>(n_));
  int64_t filled = 0;  // blocks of the open supernode's columns that are in the pattern
  for (int j = 0; j < n_; ++j) {
    std::vector<int>& mine = rows[static_cast<size_t>(j)];
    for (int child : children[static_cast<size_t>(j)]) {
      const std::vector<int>& theirs = rows[static_cast<size_t>(child)];
      mine.insert(mine.end(), theirs.begin() + 1, theirs.end());
    }
    std::sort(mine.begin(), mine.end());
    mine.erase(std::unique(mine.begin(), mine.end()), mine.end());
    if (!mine.empty()) children[static_cast<size_t>(mine.front())].push_back(j);
    // The column before passes all its rows on to this one: both in one supernode, if that holds few zeros.
    const auto mine_count = static_cast<int64_t>(mine.size());
    const bool follows =
        j > 0 && !rows[static_cast<size_t>(j) - 1].empty() && rows[static_cast<size_t>(j) - 1].front() == j;
    if (follows && supernodes_.back().width < kMostColumns) {
      const int64_t width = supernodes_.back().width + 1;
      const int64_t held = width * (width + 1) / 2 + width * mine_count;
      if (static_cast<double>(held - filled - mine_count - 1) <= kMostZeros * static_cast<double>(held)) {
        ++supernodes_.back().width;
        supernode_of_[static_cast<size_t>(j)] = static_cast<int>(supernodes_.size()) - 1;
        filled += mine_count + 1;
        continue;
      }
    }
    supernodes_.push_back({j, 1, 0, 0, 0});
    supernode_of_[static_cast<size_t>(j)] = static_cast<int>(supernodes_.size()) - 1;
    filled = mine_count + 1;
  }
  for (Supernode& supernode : supernodes_) {
    const std::vector<int>& of_last = rows[static_cast<size_t>(supernode.end()) - 1];
    supernode.begin = static_cast<int>(rows_.size());
    supernode.rows = static_cast<int>(of_last.size());
    supernode.values = size_;
    rows_.insert(rows_.end(), of_last.begin(), of_last.end());
    size_ += static_cast<size_t>(supernode.Stride() * kDim * supernode.width);
  }
  rows = {};
  into_.reserve(lower.size());
  for (const auto& [row, column] : lower) {
    const int a = position_[static_cast<size_t>(row)], b = position_[static_cast<size_t>(column)];
    into_.push_back({Find(std::max(a, b), std::min(a, b)), SupernodeOf(std::min(a, b)).Stride(), a == b, a < b});
  }
}

size_t BlockCholesky::Find(int row, int column) const {
  const Supernode& supernode = SupernodeOf(column);
  Index at = row - supernode.first;
  if (row >= supernode.end()) {
    const auto begin = rows_.begin() + supernode.begin, end = begin + supernode.rows;
    const auto it = std::lower_bound(begin, end, row);
    if (it == end || *it != row) return kNowhere;
    at = supernode.width + (it - begin);
  }
  return supernode.values + static_cast<size_t>(kDim * ((column - supernode.first) * supernode.Stride() + at));
}

std::vector<BlockCholesky::SupernodeUpdate> BlockCholesky::UpdatesOf(const Supernode& supernode) const {
  const int* rows = rows_.data() + supernode.begin;
  std::vector<SupernodeUpdate> updates;
  for (int from = 0; from < supernode.rows;) {
    const Supernode& other = SupernodeOf(rows[from]);
    SupernodeUpdate& update = updates.emplace_back(SupernodeUpdate{&other, from, from, {}});
    const int* below = rows_.data() + other.begin;
    int at = 0;
    for (int m = from; m < supernode.rows; ++m) {
      if (rows[m] < other.end()) {
        update.where.push_back(rows[m] - other.first);
        update.to = m + 1;
        continue;
      }
      while (below[at] != rows[m]) ++at;  // the rows of a column are among those of each of them that comes later
      update.where.push_back(other.width + at);
    }
    from = update.to;
  }
  return updates;
}

int BlockCholesky::ThreadsFor(const Supernode& supernode, int threads) const {
  const int64_t products = static_cast<int64_t>(supernode.width) * supernode.rows * supernode.rows;
  return products < kWorthThreads ? 1 : threads;
}

void BlockCholesky::Add(int index, const double* a, const double* b, int depth) {
  const Target& t = into_[static_cast<size_t>(index)];
  if (t.transposed) std::swap(a, b);
  AddProduct(factor_.data() + t.at, t.stride, a, b, depth);
}

bool BlockCholesky::Factorize(double damping, int threads) {
  for (size_t k = 0; k < into_.size() && damping > 0; ++k) {
    if (into_[k].diagonal) Diagonal(static_cast<int>(k)) += damping * Diagonal(static_cast<int>(k)).cwiseAbs();
  }
  for (const Supernode& supernode : supernodes_) {
    const Index stride = supernode.Stride(), width = kDim * supernode.width;
    double* const own = factor_.data() + supernode.values;
    Strided square(own, width, width, Eigen::OuterStride<>(stride));
    Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>> in_place(square);
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>, Eigen::Lower> llt(in_place);
    if (llt.info() != Eigen::Success) return false;
    if (supernode.rows == 0) continue;
    double* const below = own + width;
    Strided rows(below, kDim * supernode.rows, width, Eigen::OuterStride<>(stride));
    square.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(rows);
    // The update of the columns to the right; each thread updates a supernode of its own.
    const std::vector<SupernodeUpdate> updates = UpdatesOf(supernode);
    ParallelFor(static_cast<int64_t>(updates.size()), ThreadsFor(supernode, threads), {}, [&](int64_t index) {
      const SupernodeUpdate& update = updates[static_cast<size_t>(index)];
      const auto block = [&](int m, int k) { return below + kDim * (update.from + m + k * stride); };
      std::vector<std::ptrdiff_t> groups;
      const int count = update.to - update.from;
      for (int m = 0; m < count; ++m)
        AppendGroups(update.where[static_cast<size_t>(m)], update.other->Stride(), &groups);
      double* const theirs = factor_.data() + update.other->values;
      const PackedRight columns(supernode.width, 2 * count, stride, 1, [&](int k) { return block(0, k); });
      columns.SubtractProduct(
          supernode.rows - update.from, 1, stride, block,
          [&](int m) { return theirs + kDim * update.where[static_cast<size_t>(m)]; }, groups.data(),
          update.other->Stride());
    });
  }
  return true;
}

void BlockCholesky::Solve(Eigen::Ref<Eigen::VectorXd> x) const {
  Eigen::VectorXd y(x.size()), part;
  for (int b = 0; b < n_; ++b) y.segment<kDim>(kDim * position_[static_cast<size_t>(b)]) = x.segment<kDim>(kDim * b);
  const auto with = [&](const Supernode& supernode, auto&& use) {
    const Index stride = supernode.Stride(), width = kDim * supernode.width;
    const double* own = factor_.data() + supernode.values;
    const ConstStrided square(own, width, width, Eigen::OuterStride<>(stride));
    const ConstStrided below(own + width, kDim * supernode.rows, width, Eigen::OuterStride<>(stride));
    use(square, below, y.segment(kDim * supernode.first, width), rows_.data() + supernode.begin);
  };
  for (const Supernode& supernode : supernodes_) {
    with(supernode, [&](const auto& square, const auto& below, auto&& own, const int* rows) {
      square.template triangularView<Eigen::Lower>().solveInPlace(own);
      part.noalias() = below * own;
      for (int m = 0; m < supernode.rows; ++m) y.segment<kDim>(kDim * rows[m]) -= part.segment<kDim>(kDim * m);
    });
  }
  for (auto supernode = supernodes_.rbegin(); supernode != supernodes_.rend(); ++supernode) {
    with(*supernode, [&](const auto& square, const auto& below, auto&& own, const int* rows) {
      part.resize(kDim * supernode->rows);
      for (int m = 0; m < supernode->rows; ++m) part.segment<kDim>(kDim * m) = y.segment<kDim>(kDim * rows[m]);
      own.noalias() -= below.transpose() * part;
      square.template triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    });
  }
  for (int b = 0; b < n_; ++b) x.segment<kDim>(kDim * b) = y.segment<kDim>(kDim * position_[static_cast<size_t>(b)]);
}

BlockCholesky::Inverse BlockCholesky::SelectedInverse(int threads) const& { return Invert(factor_, threads); }

BlockCholesky::Inverse BlockCholesky::SelectedInverse(int threads) && { return Invert(std::move(factor_), threads); }

BlockCholesky::Inverse BlockCholesky::Invert(std::vector<double> factor, int threads) const {
  Inverse z;
  z.factor_ = this;
  z.values_ = std::move(factor);
  for (auto it = supernodes_.rbegin(); it != supernodes_.rend(); ++it) {
    const Supernode& supernode = *it;
    const Index stride = supernode.Stride(), width = kDim * supernode.width, height = kDim * supernode.rows;
    Strided own(z.values_.data() + supernode.values, width, width, Eigen::OuterStride<>(stride));
    Strided below(z.values_.data() + supernode.values + width, height, width, Eigen::OuterStride<>(stride));
    const Eigen::MatrixXd inverse = own.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(width, width));
    own.noalias() = inverse.transpose() * inverse;
    if (supernode.rows == 0) continue;
    Eigen::MatrixXd unit = below;
    unit *= inverse.triangularView<Eigen::Lower>();  // U = L_B L_D^-1
    below.setZero();
    std::vector<std::ptrdiff_t> groups;
    for (int q = 0; q < supernode.width; ++q) AppendGroups(q, stride, &groups);
    // Z_B = - Z_BB U. Z_BB lies in the supernodes whose columns these rows are: the pattern is closed under this sum.
    const std::vector<SupernodeUpdate> updates = UpdatesOf(supernode);
    std::vector<PackedRight> right;
    for (const SupernodeUpdate& update : updates) {
      right.emplace_back(update.to - update.from, 2 * supernode.width, 1, height,
                         [&](int k) { return unit.data() + kDim * (update.from + k); });
    }
    ParallelFor(static_cast<int64_t>(updates.size()), ThreadsFor(supernode, threads), {}, [&](int64_t index) {
      const SupernodeUpdate& mine = updates[static_cast<size_t>(index)];
      for (size_t k = 0; k < updates.size(); ++k) {
        // Of two supernodes the one further left has the block; above its diagonal it is seen from the other side.
        const bool left = updates[k].from <= mine.from;
        const SupernodeUpdate &at_rows = left ? updates[k] : mine, &of_rows = left ? mine : updates[k];
        const Index their_stride = at_rows.other->Stride();
        const double* const theirs = z.values_.data() + at_rows.other->values;
        const auto block = [&](int i, int column) {
          const int row = of_rows.from - at_rows.from + (left ? i : column);
          const Index of_column = at_rows.where[static_cast<size_t>(left ? column : i)];
          return theirs + kDim * (at_rows.where[static_cast<size_t>(row)] + of_column * their_stride);
        };
        right[k].SubtractProduct(
            mine.to - mine.from, left ? 1 : their_stride, left ? their_stride : 1, block,
            [&](int i) { return below.data() + kDim * (mine.from + i); }, groups.data(), stride);
      }
    });
    own.noalias() -= unit.transpose() * below;
    own = (0.5 * (own + own.transpose())).eval();
  }
  return z;
}

Matrix6d BlockCholesky::Inverse::Block(int row, int column) const {
  const int a = factor_->position_[static_cast<size_t>(row)], b = factor_->position_[static_cast<size_t>(column)];
  const size_t at = factor_->Find(std::max(a, b), std::min(a, b));
  if (at == kNowhere) return Matrix6d::Zero();
  const Matrix6d block = Eigen::Map<const Matrix6d, 0, Eigen::OuterStride<>>(
      values_.data() + at, Eigen::OuterStride<>(factor_->SupernodeOf(std::min(a, b)).Stride()));
  return a >= b ? block : Matrix6d(block.transpose());
}

}  // namespace trigpoint
