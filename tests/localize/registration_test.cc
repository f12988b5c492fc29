// Which matches near their predicted place are worth having.
#include "localize/references/registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kRadius = 6, kSigma = 0.8, kMost = 13.8;

// Distances from the prediction, px.
struct Found {
  std::vector<double> right, chance;
  double support = 0;
  int outer = 0;
};

Found Search(int right, int chance, uint64_t seed) {
  Random random(seed);
  Found found;
  for (int i = 0; i < right; ++i) found.right.push_back(kSigma * std::hypot(random.Normal(), random.Normal()));
  for (int i = 0; i < chance; ++i) found.chance.push_back(kRadius * std::sqrt(random.Uniform()));
  int inner = 0;
  for (const auto* distances : {&found.right, &found.chance}) {
    for (double e : *distances) ++(e < 0.5 * kRadius ? inner : found.outer);
  }
  found.support = inner - found.outer / 3.0;
  return found;
}

int Between(const std::vector<double>& distances, double from, double to) {
  int count = 0;
  for (double e : distances) count += e >= from && e < to ? 1 : 0;
  return count;
}

TEST(ChanceGate, LiesWhereRightAndChanceMatchesAreAsMany) {
  for (int chance : {8000, 20000}) {
    const Found found = Search(60000, chance, 1);
    const double gate = ChanceGate(found.support, found.outer, kRadius, kSigma, kMost);
    ASSERT_GT(gate, 5.99);
    ASSERT_LT(gate, kMost);
    const double at = kSigma * std::sqrt(gate);
    const double right = Between(found.right, at - 0.1, at + 0.1), wrong = Between(found.chance, at - 0.1, at + 0.1);
    EXPECT_NEAR(right / wrong, 1, 0.25) << chance;
  }
}

TEST(ChanceGate, StaysWithinItsLimits) {
  EXPECT_EQ(ChanceGate(500, 0, kRadius, kSigma, kMost), kMost);    // nothing but right ones
  EXPECT_EQ(ChanceGate(1e9, 1, kRadius, kSigma, kMost), kMost);    // hardly anything else
  EXPECT_EQ(ChanceGate(-20, 300, kRadius, kSigma, kMost), 5.99);   // nothing but chance
  EXPECT_EQ(ChanceGate(100, 1000, kRadius, kSigma, kMost), 5.99);  // mostly
  EXPECT_EQ(ChanceGate(100, 1000, kRadius, kSigma, 4.0), 4.0);     // asked for less
}

}  // namespace
}  // namespace trigpoint
