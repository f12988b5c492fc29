// Distributions and paired tests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "eval/errors/paired.h"
#include "eval/errors/paper_tables.h"
#include "eval/statistics/distributions.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;

TEST(Distributions, AgreeWithTables) {
  EXPECT_NEAR(NormalQuantile(0.975), 1.959963984540054, 1e-10);
  EXPECT_NEAR(NormalCdf(-1), 0.15865525393145707, 1e-12);
  EXPECT_NEAR(ChiSquareQuantile(0.95, 1), 3.841458820694124, 1e-8);
  EXPECT_NEAR(ChiSquareQuantile(0.95, 3), 7.814727903251179, 1e-8);
  EXPECT_NEAR(ChiSquareQuantile(0.025, 10), 3.246972780236841, 1e-8);
  EXPECT_NEAR(ChiSquareQuantile(0.975, 100), 129.56119718583659, 1e-6);
  EXPECT_NEAR(ChiSquareCdf(2 * std::log(2.0), 2), 0.5, 1e-12);
  EXPECT_NEAR(BinomialCdf(2, 9, 0.5), 46.0 / 512, 1e-12);
  EXPECT_TRUE(std::isnan(NormalCdf(std::nan(""))));
  EXPECT_EQ(ChiSquareCdf(-1, 3), 0);
  EXPECT_EQ(BinomialCdf(-1, 9, 0.5), 0);
  EXPECT_EQ(BinomialCdf(9, 9, 0.5), 1);
  EXPECT_THROW(NormalQuantile(1), NumericError);
  EXPECT_THROW(ChiSquareQuantile(0.5, 0), NumericError);
}

TEST(PairedTests, AgreeWithHandCounts) {
  // 9 differences, 2 negative: 2 * (1 + 9 + 36) / 512.
  EXPECT_NEAR(SignTest({1, 2, 3, 4, 5, 6, 7, -1, -2}), 92.0 / 512, 1e-12);
  EXPECT_DOUBLE_EQ(SignTest({0, 0}), 1);
  // Six differences all positive: 2 of 64 patterns are as extreme.
  EXPECT_NEAR(WilcoxonSignedRankTest({0.1, 0.2, 0.3, 0.4, 0.5, 0.6}), 2.0 / 64, 1e-12);
  // Smaller rank sum 3 of n = 6: sums 0, 1, 2, 3 (3 = 3 and 1 + 2): five patterns each side.
  EXPECT_NEAR(WilcoxonSignedRankTest({0.1, 0.2, -0.3, 0.4, 0.5, 0.6}), 10.0 / 64, 1e-12);
  EXPECT_DOUBLE_EQ(WilcoxonSignedRankTest({}), 1);
}

TEST(PairedTests, RejectAsOftenAsStated) {
  Random random(3);
  int exact = 0, normal = 0;
  constexpr int kTrials = 2000;
  for (int t = 0; t < kTrials; ++t) {
    std::vector<double> small, large;
    for (int i = 0; i < 15; ++i) small.push_back(random.Normal());
    for (int i = 0; i < 60; ++i) large.push_back(random.Normal());
    exact += WilcoxonSignedRankTest(small) < 0.05;
    normal += WilcoxonSignedRankTest(large) < 0.05;
  }
  EXPECT_NEAR(exact, 0.047 * kTrials, 4 * std::sqrt(0.05 * kTrials));
  EXPECT_NEAR(normal, 0.05 * kTrials, 4 * std::sqrt(0.05 * kTrials));
}

std::vector<ErrorRow> RowsOf(const PaperTable& table) {
  std::vector<ErrorRow> rows;
  for (size_t r = 0; r < table.error_m.size(); ++r) {
    for (size_t s = 0; s < table.error_m[r].size(); ++s) {
      rows.push_back({.run = std::to_string(r), .station = std::to_string(s), .error_3d_m = table.error_m[r][s]});
    }
  }
  return rows;
}

// Connecting the views of a panorama: is it better in the paper's own tables?
TEST(ComparePaired, OfThePapersTables) {
  const PairedComparison c = ComparePaired(RowsOf(PaperTables()[0]), RowsOf(PaperTables()[1]), {.samples = 500});
  EXPECT_EQ(c.pairs, 36);
  EXPECT_EQ(c.only_a + c.only_b, 0);
  EXPECT_EQ(c.stations, 9);
  EXPECT_EQ(c.a_better + c.b_better, 19);  // the other 17 are equal
  EXPECT_EQ(c.b_better, 12);
  EXPECT_NEAR(*c.median_difference_m, 0, 1e-12);
  EXPECT_GT(c.wilcoxon_p, 0.05);
  EXPECT_THAT(Describe(c, "G1", "G2"), HasSubstr("G2 is better than G1 in 12 of 36 pairs"));
}

TEST(ComparePaired, CountsAnswersOfOneSide) {
  const std::vector<ErrorRow> a{{.run = "1", .station = "A", .error_3d_m = 1}, {.run = "1", .station = "B"}};
  const std::vector<ErrorRow> b{{.run = "1", .station = "B", .error_3d_m = 1},
                                {.run = "2", .station = "A", .error_3d_m = 2}};
  const PairedComparison c = ComparePaired(a, b);
  EXPECT_EQ(c.pairs, 0);
  EXPECT_EQ(c.only_a, 1);
  EXPECT_EQ(c.only_b, 2);
  EXPECT_THAT(Describe(c, "a", "b"), HasSubstr("no answer in common"));
}

}  // namespace
}  // namespace trigpoint
