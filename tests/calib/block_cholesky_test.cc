// The block factorisation against dense linear algebra, on patterns of runs with and without loops.
#include "calib/estimation/block_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

struct System {
  std::vector<std::pair<int, int>> lower;
  std::vector<Matrix6d> values;
  Eigen::MatrixXd dense;
};

// A band of `width` blocks, and `loops` links between far-off blocks; symmetric positive definite.
System MakeSystem(int blocks, int width, int loops, uint64_t seed) {
  Random random(seed);
  System s;
  for (int i = 0; i < blocks; ++i) s.lower.emplace_back(i, i);
  for (int i = 0; i < blocks; ++i) {
    for (int j = std::max(0, i - width); j < i; ++j) s.lower.emplace_back(i, j);
  }
  for (int k = 0; k < loops; ++k) s.lower.emplace_back(blocks - 1 - k, k);
  s.dense = Eigen::MatrixXd::Zero(6 * blocks, 6 * blocks);
  for (const auto& [i, j] : s.lower) {
    Matrix6d m;
    for (int k = 0; k < 36; ++k) m(k) = random.Normal();
    if (i == j) m = Matrix6d(m * m.transpose() + 40.0 * (width + loops + 1) * Matrix6d::Identity());
    s.values.push_back(m);
    s.dense.block<6, 6>(6 * i, 6 * j) = m;
    s.dense.block<6, 6>(6 * j, 6 * i) = m.transpose();
  }
  return s;
}

bool Factorize(const System& s, double damping, BlockCholesky* cholesky) {
  cholesky->SetZero();
  for (size_t k = 0; k < s.values.size(); ++k) {
    cholesky->Add<6>(static_cast<int>(k), s.values[k], Matrix6d::Identity());
  }
  return cholesky->Factorize(damping);
}

class BlockCholeskyOn : public testing::TestWithParam<std::tuple<int, int, int>> {};

TEST_P(BlockCholeskyOn, AgreesWithDense) {
  const auto [blocks, width, loops] = GetParam();
  const System s = MakeSystem(blocks, width, loops, 11);
  BlockCholesky cholesky(blocks, s.lower);
  ASSERT_TRUE(Factorize(s, 0, &cholesky));
  Random random(5);
  Eigen::VectorXd b(6 * blocks);
  for (Eigen::Index i = 0; i < b.size(); ++i) b(i) = random.Normal();
  Eigen::VectorXd x = b;
  cholesky.Solve(x);
  EXPECT_LT((s.dense * x - b).norm(), 1e-10 * b.norm());
  const Eigen::MatrixXd inverse = s.dense.inverse();
  const BlockCholesky::Inverse z = cholesky.SelectedInverse();
  const BlockCholesky::Inverse in_place = std::move(cholesky).SelectedInverse();
  for (const auto& [i, j] : s.lower) {
    const Matrix6d expected = inverse.block<6, 6>(6 * i, 6 * j);
    EXPECT_LT((z.Block(i, j) - expected).norm(), 1e-12 * inverse.norm()) << i << "," << j;
    EXPECT_LT((z.Block(j, i) - expected.transpose()).norm(), 1e-12 * inverse.norm());
    EXPECT_EQ(in_place.Block(i, j), z.Block(i, j));
  }
}
INSTANTIATE_TEST_SUITE_P(Patterns, BlockCholeskyOn,
                         testing::Values(std::tuple(1, 0, 0), std::tuple(2, 1, 0), std::tuple(30, 4, 0),
                                         std::tuple(30, 3, 5), std::tuple(12, 11, 0), std::tuple(9, 0, 0)));

TEST(BlockCholesky, DampingAddsToTheDiagonal) {
  const System s = MakeSystem(8, 2, 0, 3);
  BlockCholesky cholesky(8, s.lower);
  ASSERT_TRUE(Factorize(s, 0.25, &cholesky));
  Eigen::MatrixXd damped = s.dense;
  damped.diagonal() *= 1.25;
  Eigen::VectorXd x = Eigen::VectorXd::Ones(48);
  cholesky.Solve(x);
  EXPECT_LT((damped * x - Eigen::VectorXd::Ones(48)).norm(), 1e-11);
}

TEST(BlockCholesky, RefusesWhatIsNotPositiveDefinite) {
  System s = MakeSystem(6, 2, 0, 3);
  s.values[4](2, 2) = -1;
  BlockCholesky cholesky(6, s.lower);
  EXPECT_FALSE(Factorize(s, 0, &cholesky));
  s.values[4] = Matrix6d::Zero();  // a pose that nothing determines
  EXPECT_FALSE(Factorize(s, 0, &cholesky));
}

}  // namespace
}  // namespace trigpoint
