#include "eval/statistics/bootstrap.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

#include "calib/estimation/random.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

// A kind of campaign: shares of the variance that stations, runs, and the answers of one run at one station have; the
// rest is the single answer's own.
struct Design {
  int runs, stations;
  double station_share, run_share;
  int answers = 1;  // of a run at a station
  double cell_share = 0;
};

// Errors of one campaign, 15 % of the answers missing. Log-normal (sigma 0.8), or lengths of 3D vectors (Maxwell).
std::vector<ClusteredValue> Campaign(const Design& d, bool maxwell, Random* random) {
  using Row = Eigen::RowVector3d;
  const auto normal = [&] { return Row(random->Normal(), random->Normal(), random->Normal()); };
  std::vector<Row> station, run;
  for (int s = 0; s < d.stations; ++s) station.push_back(std::sqrt(d.station_share) * normal());
  for (int r = 0; r < d.runs; ++r) run.push_back(std::sqrt(d.run_share) * normal());
  std::vector<ClusteredValue> errors;
  for (int r = 0; r < d.runs; ++r) {
    for (int s = 0; s < d.stations; ++s) {
      Row common = station[static_cast<size_t>(s)] + run[static_cast<size_t>(r)];
      if (d.cell_share > 0) common += std::sqrt(d.cell_share) * normal();
      for (int k = 0; k < d.answers; ++k) {
        const Row v = common + std::sqrt(1 - d.station_share - d.run_share - d.cell_share) * normal();
        const double error = maxwell ? v.norm() : std::exp(0.8 * v.x());
        if (random->Uniform() < 0.85) errors.push_back({error, s, r});
      }
    }
  }
  return errors;
}

double TrueQuantile(bool maxwell, double q) {
  return maxwell ? std::sqrt(ChiSquareQuantile(q, 3)) : std::exp(0.8 * NormalQuantile(q));
}

// Of 200 campaigns, how many intervals hold the truth.
TEST(ClusteredQuantileInterval, CoversTheTruthAsStated) {
  constexpr int kCampaigns = 200;
  const BootstrapOptions options{.samples = 300};
  for (const Design& d :
       {Design{1, 9, 0.5, 0}, Design{2, 9, 0, 0}, Design{2, 9, 0.5, 0.1}, Design{3, 9, 0.5, 0.2}, Design{5, 9, 0, 0},
        Design{5, 9, 0.4, 0.2}, Design{4, 20, 0.5, 0.1}, Design{1, 9, 0, 0, 6, 0.8}, Design{3, 9, 0.2, 0.1, 4, 0.5}}) {
    for (const bool maxwell : {false, true}) {
      for (const double q : {0.5, 0.9}) {
        Random random(17);
        int covered = 0;
        for (int i = 0; i < kCampaigns; ++i) {
          const auto interval = ClusteredQuantileInterval(Campaign(d, maxwell, &random), q, options);
          const double truth = TrueQuantile(maxwell, q);
          covered += interval && interval->low <= truth && truth <= interval->high;
        }
        const std::string what = std::to_string(d.runs) + " runs, " + std::to_string(d.stations) +
                                 " stations, shares " + std::to_string(d.station_share) + " and " +
                                 std::to_string(d.run_share) + (maxwell ? ", maxwell" : ", log-normal") + ", " +
                                 std::to_string(d.answers) + " answers, share " + std::to_string(d.cell_share) +
                                 ", quantile " + std::to_string(q);
        std::printf("%5.1f %% %s\n", 100.0 * covered / kCampaigns, what.c_str());
        EXPECT_GE(covered, 180) << what;
        EXPECT_LE(covered, 198) << what;
      }
    }
  }
}

// One side of a comparison converges to a wrong place in a fifth of its answers: such gross errors say nothing about
// the median difference, and its interval is not as wide as they are large.
TEST(ClusteredQuantileInterval, OfDifferencesHoldsTheTruthDespiteGrossErrors) {
  const auto difference = [](double station, Random* random) {
    const double fine = 0.2 + 0.1 * station + 0.1 * random->Normal();
    return random->Uniform() < 0.2 ? fine + 5 - 10 * std::log(1 - random->Uniform()) : fine;
  };
  Random random(5);
  std::vector<double> many;
  for (int i = 0; i < 100000; ++i) many.push_back(difference(random.Normal(), &random));
  const double truth = Quantile(many, 0.5);
  constexpr int kCampaigns = 200;
  int covered = 0;
  std::vector<double> widths;
  for (int i = 0; i < kCampaigns; ++i) {
    std::vector<ClusteredValue> differences;
    for (int s = 0; s < 9; ++s) {
      const double station = random.Normal();
      for (int r = 0; r < 3; ++r) differences.push_back({difference(station, &random), s, r});
    }
    const auto interval = ClusteredQuantileInterval(differences, 0.5, {.samples = 300}, BootstrapScale::kLinear);
    ASSERT_TRUE(interval);
    covered += interval->low <= truth && truth <= interval->high;
    widths.push_back(interval->high - interval->low);
  }
  std::printf("%5.1f %%, width %.3f\n", 100.0 * covered / kCampaigns, Quantile(widths, 0.5));
  EXPECT_GE(covered, 180);
  EXPECT_LT(Quantile(widths, 0.5), 2);  // gross errors are 5 to 50
}

TEST(ClusteredQuantileInterval, IsWiderWhereStationsAgreeWithThemselves) {
  // The same 36 numbers, once each station repeating its error in every run, once spread at random.
  std::vector<ClusteredValue> clustered, spread;
  for (int s = 0; s < 9; ++s) {
    for (int r = 0; r < 4; ++r) {
      const double error = std::exp(0.3 * (s - 4)) * (1 + 0.01 * r);
      clustered.push_back({error, s, r});
      spread.push_back({error, (s * 4 + r) % 9, (s + r) % 4});
    }
  }
  const auto a = ClusteredQuantileInterval(clustered, 0.5), b = ClusteredQuantileInterval(spread, 0.5);
  ASSERT_TRUE(a && b);
  EXPECT_GT(std::log(a->high / a->low), 1.4 * std::log(b->high / b->low));
}

TEST(ClusteredQuantileInterval, RepeatsAndRefusesTooLittle) {
  Random random(1);
  const auto errors = Campaign({2, 9, 0.3, 0.1}, false, &random);
  const auto a = ClusteredQuantileInterval(errors, 0.5), b = ClusteredQuantileInterval(errors, 0.5);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->low, b->low);
  EXPECT_EQ(a->high, b->high);
  EXPECT_FALSE(ClusteredQuantileInterval({{1, 0, 0}, {2, 1, 0}}, 0.5));
  EXPECT_FALSE(ClusteredQuantileInterval({{1, 0, 0}, {1, 1, 0}, {1, 2, 0}}, 0.5));
  // Units do not matter.
  auto millimetres = errors;
  for (ClusteredValue& e : millimetres) e.value *= 1000;
  EXPECT_NEAR(ClusteredQuantileInterval(millimetres, 0.5)->high, 1000 * a->high, 1e-6 * a->high);
}

TEST(CumulativeHistogram, EndsAtTheAnsweredShareWithinItsBand) {
  Random random(5);
  const auto errors = Campaign({3, 9, 0.3, 0.1}, false, &random);
  const int abstentions = 27 - static_cast<int>(errors.size());
  const auto curve = CumulativeHistogram(errors, abstentions, {.samples = 200});
  ASSERT_EQ(curve.size(), errors.size());
  EXPECT_NEAR(curve.back().share, static_cast<double>(errors.size()) / 27, 1e-12);
  for (size_t i = 0; i < curve.size(); ++i) {
    EXPECT_LE(curve[i].low, curve[i].share + 1e-12);
    EXPECT_GE(curve[i].high + 1.0 / 27, curve[i].share);
    if (i == 0) continue;
    EXPECT_GT(curve[i].share, curve[i - 1].share);
  }
  EXPECT_TRUE(CumulativeHistogram({}, 3).empty());
}

}  // namespace
}  // namespace trigpoint
