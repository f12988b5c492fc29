#include "calib/estimation/ransac.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

struct Line {
  double slope = 0, offset = 0;
};

struct Scene {
  std::vector<double> x, y;
  int inliers = 0;

  Scene(int good, int bad, uint64_t seed) : inliers(good) {
    Random random(seed);
    for (int i = 0; i < good + bad; ++i) {
      x.push_back(random.Uniform(-10, 10));
      y.push_back(i < good ? 0.7 * x.back() - 2 + 0.01 * random.Normal() : random.Uniform(-10, 10));
    }
  }
  RansacResult<Line> Fit(const RansacOptions& options, const std::vector<Line>& guesses = {}) const {
    const auto sample = [&](const std::vector<int>& i) {
      const double slope = (y[i[1]] - y[i[0]]) / (x[i[1]] - x[i[0]]);
      return std::vector<Line>{{slope, y[i[0]] - slope * x[i[0]]}};
    };
    const auto residual = [&](const Line& line, int i) { return std::abs(line.slope * x[i] + line.offset - y[i]); };
    return Ransac<Line, 2>(static_cast<int>(x.size()), options, sample, residual, guesses);
  }
};

RansacOptions Options() {
  RansacOptions options;
  options.threshold = 0.05;
  return options;
}

TEST(Ransac, FindsTheModelAmongOutliers) {
  const Scene scene(60, 140, 3);
  const auto result = scene.Fit(Options());
  ASSERT_TRUE(result.found);
  EXPECT_NEAR(result.model.slope, 0.7, 0.02);
  EXPECT_NEAR(result.model.offset, -2, 0.05);
  EXPECT_GE(result.inliers.size(), 55U);
  EXPECT_TRUE(std::is_sorted(result.inliers.begin(), result.inliers.end()));
}

TEST(Ransac, RepeatsBitForBitWithASeedAndIgnoresTheGlobalOne) {
  const Scene scene(60, 140, 4);
  std::srand(1);
  const auto a = scene.Fit(Options());
  std::srand(2);
  const auto b = scene.Fit(Options());
  EXPECT_EQ(a.model.slope, b.model.slope);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.iterations, b.iterations);
  RansacOptions other = Options();
  other.seed = 99;
  EXPECT_NE(a.model.slope, scene.Fit(other).model.slope);
}

TEST(Ransac, StopsWhenItIsSure) {
  const Scene easy(200, 0, 5), hard(40, 160, 5);
  RansacOptions options = Options();
  options.max_iterations = 100000;
  EXPECT_LE(easy.Fit(options).iterations, 60);
  // 20 % inliers: log(1e-4) / log(1 - 0.04) = 226 samples for a share that is met exactly.
  const int iterations = hard.Fit(options).iterations;
  EXPECT_GT(iterations, 100);
  EXPECT_LT(iterations, 600);
}

TEST(Ransac, TakesAGuessAndSaysWhenThereIsNothing) {
  const Scene scene(60, 140, 6);
  RansacOptions options = Options();
  options.max_iterations = options.min_iterations = 0;
  EXPECT_FALSE(scene.Fit(options).found);
  const auto guessed = scene.Fit(options, {{0.7, -2}});
  EXPECT_TRUE(guessed.found);
  EXPECT_GE(guessed.inliers.size(), 55U);
  const Scene single(1, 0, 7);
  EXPECT_FALSE(single.Fit(Options()).found);
}

TEST(Random, IsUniformAndNormal) {
  Random random(11);
  const int n = 200000;
  double sum = 0, sum2 = 0, sum4 = 0;
  std::vector<int> bins(10);
  for (int i = 0; i < n; ++i) {
    ++bins[random.Below(10)];
    const double z = random.Normal();
    sum += z, sum2 += z * z, sum4 += z * z * z * z;
  }
  for (const int count : bins) EXPECT_NEAR(count, n / 10, 5 * std::sqrt(n * 0.09));
  EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(sum2 / n, 1, 5 * std::sqrt(2.0 / n));
  EXPECT_NEAR(sum4 / n, 3, 5 * std::sqrt(96.0 / n));
}

TEST(Random, IsTheSameEverywhere) {
  Random random(0);  // the first value of SplitMix64 as published for seed 0
  EXPECT_EQ(random.Next(), 0xe220a8397b1dcdafULL);
}

}  // namespace
}  // namespace trigpoint
