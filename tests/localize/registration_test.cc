// Which matches near their predicted place are worth having.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/estimation/random.h"
#include "localize/references/chance_match.h"

namespace trigpoint {
namespace {

constexpr double kRadius = 6, kSigma = 0.8;

// Matches of near points have larger descriptor distances, and more of them are there by chance. Neither depth nor
// descriptor distance alone tells the true ones.
struct Search {
  std::vector<FoundMatch> matches;
  std::vector<bool> right;
  std::vector<double> chi2;
};

double ShareOf(double descriptor_distance, double depth_m) {
  return 1 / (1 + std::exp(-(4 - 10 * descriptor_distance + std::log(depth_m / 20))));
}

Search Find(int count, uint64_t seed) {
  Random random(seed);
  Search search;
  for (int i = 0; i < count; ++i) {
    FoundMatch m{0, 0.2 + 0.6 * random.Uniform(), 3 * std::exp(3 * random.Uniform())};
    const bool right = random.Uniform() < ShareOf(m.descriptor_distance, m.depth_m);
    m.error_px = right ? kSigma * std::hypot(random.Normal(), random.Normal()) : kRadius * std::sqrt(random.Uniform());
    search.matches.push_back(m);
    search.right.push_back(right);
    search.chi2.push_back(m.error_px * m.error_px / (kSigma * kSigma));
  }
  return search;
}

TEST(TrueShares, FollowWhatMatchesLookLikeAndHowFarTheirPointsAre) {
  const Search search = Find(20000, 1);
  const std::vector<double> shares = TrueShares(search.matches, kRadius);
  ASSERT_EQ(shares.size(), search.matches.size());
  for (size_t i = 0; i < shares.size(); i += 37) {
    const FoundMatch& m = search.matches[i];
    EXPECT_NEAR(shares[i], ShareOf(m.descriptor_distance, m.depth_m), 0.06)
        << m.descriptor_distance << " " << m.depth_m;
  }
}

TEST(TrueShares, AreAlikeWhereMatchesAreFew) {
  EXPECT_TRUE(TrueShares({}, kRadius).empty());
  // Three alike inside, of which a quarter would be by chance: likely true, and none more than another.
  const std::vector<double> shares = TrueShares({{0.5, 0.4, 10}, {1, 0.4, 10}, {0.7, 0.4, 10}}, kRadius);
  for (double share : shares) {
    EXPECT_GT(share, 0.5);
    EXPECT_NEAR(share, shares.front(), 1e-9);
  }
}

// Of the matches that are said to be true with about some probability, so many are.
TEST(TrueProbability, IsCalibrated) {
  const Search search = Find(60000, 2);
  const std::vector<double> shares = TrueShares(search.matches, kRadius);
  std::vector<int> count(5), right(5);
  for (size_t i = 0; i < shares.size(); ++i) {
    const double p = TrueProbability(shares[i], search.chi2[i], 1, kRadius / kSigma);
    const size_t bin = std::min<size_t>(4, static_cast<size_t>(5 * p));
    ++count[bin];
    right[bin] += search.right[i] ? 1 : 0;
  }
  for (size_t bin = 0; bin < 5; ++bin) {
    ASSERT_GT(count[bin], 300);
    EXPECT_NEAR(static_cast<double>(right[bin]) / count[bin], (static_cast<double>(bin) + 0.5) / 5, 0.1) << bin;
  }
}

TEST(TrueProbability, HasItsLimits) {
  EXPECT_EQ(TrueProbability(1, 4, 1, 6), 1);                // nothing but true ones
  EXPECT_EQ(TrueProbability(0, 0, 1, 6), 0);                // nothing but chance
  EXPECT_EQ(TrueProbability(0.9, 1e6, 1, 6), 0);            // far off
  EXPECT_NEAR(TrueProbability(0.5, 0, 18, 6), 0.5, 1e-12);  // a point so uncertain that either is as likely anywhere
}

}  // namespace
}  // namespace trigpoint
