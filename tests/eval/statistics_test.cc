#include "eval/statistics/statistics.h"

#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "eval/errors/paper_tables.h"

namespace trigpoint {
namespace {

TEST(Quantile, InterpolatesBetweenOrderStatistics) {
  EXPECT_DOUBLE_EQ(Quantile({3, 1, 2}, 0.5), 2);
  EXPECT_DOUBLE_EQ(Quantile({4, 1, 2, 3}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(Quantile({1, 2, 3, 4, 5, 6, 7, 8, 9, 10}, 0.9), 9.1);
  EXPECT_DOUBLE_EQ(Quantile({7}, 0.9), 7);
  EXPECT_DOUBLE_EQ(Quantile({1, 2}, 1), 2);
  EXPECT_THROW(Quantile({}, 0.5), InputError);
}

TEST(Quantile, AnAbstentionIsWorseThanAnyNumber) {
  EXPECT_DOUBLE_EQ(*QuantileOverAttempts({1, 2, 3}, 1, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(*QuantileOverAttempts({1, 2, 3}, 2, 0.5), 3);
  EXPECT_FALSE(QuantileOverAttempts({1, 2, 3}, 3, 0.5));
  EXPECT_FALSE(QuantileOverAttempts({1, 2, 3}, 1, 0.9));
  EXPECT_FALSE(QuantileOverAttempts({}, 2, 0.5));
  EXPECT_FALSE(QuantileOverAttempts({}, 0, 0.5));
  EXPECT_DOUBLE_EQ(*QuantileOverAttempts({5, 1}, 0, 0.25), Quantile({1, 5}, 0.25));
}

TEST(Summarize, CountsAnswersAndAttempts) {
  const ErrorStatistics s = Summarize({0.5, 1.2, 2.0}, 1);
  EXPECT_EQ(s.answers, 3);
  EXPECT_EQ(s.attempts, 4);
  EXPECT_DOUBLE_EQ(*s.median, 1.2);
  EXPECT_DOUBLE_EQ(*s.median_attempts, 1.6);
  EXPECT_FALSE(s.p90_attempts);
  EXPECT_DOUBLE_EQ(s.within_1m, 1 / 3.0);
  EXPECT_DOUBLE_EQ(s.within_1m5_attempts, 0.5);
  EXPECT_FALSE(Summarize({}, 5).median);
}

ErrorStatistics OfPaper(const PaperTable& table) {
  std::vector<double> errors;
  int blanks = 0;
  for (const auto& run : table.error_m) {
    for (const auto& cell : run) cell ? errors.push_back(*cell) : void(++blanks);
  }
  return Summarize(errors, blanks);
}

// What the published tables say, recomputed once by hand.
TEST(PaperTables, GiveThePublishedStatistics) {
  const ErrorStatistics g1 = OfPaper(PaperTables()[0]);
  EXPECT_EQ(g1.answers, 36);
  EXPECT_EQ(g1.attempts, 45);
  EXPECT_NEAR(*g1.median, 1.41, 0.005);
  EXPECT_NEAR(*g1.mean, 2.69, 0.005);
  EXPECT_NEAR(g1.within_1m, 0.306, 0.0005);

  const ErrorStatistics g2 = OfPaper(PaperTables()[1]);
  EXPECT_EQ(g2.answers, 36);
  EXPECT_EQ(g2.attempts, 45);
  EXPECT_NEAR(*g2.median, 1.25, 0.0051);
  EXPECT_NEAR(*g2.mean, 2.14, 0.005);
  EXPECT_NEAR(*g2.p90, 4.5, 0.05);
  EXPECT_NEAR(*g2.max, 10.1, 0.05);
  EXPECT_NEAR(g2.within_1m, 0.333, 0.0005);
  EXPECT_NEAR(g2.within_1m5, 0.556, 0.0005);
  EXPECT_LT(*g2.median, *g2.median_attempts);  // the nine blanks are no good answers
}

}  // namespace
}  // namespace trigpoint
