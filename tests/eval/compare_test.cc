#include "eval/errors/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint {
namespace {

using ::testing::HasSubstr;

std::vector<ErrorRow> Rows(const std::string& method, double error, int stations) {
  std::vector<ErrorRow> rows;
  for (int s = 0; s < stations; ++s) {
    rows.push_back({.run = "run1",
                    .method = method,
                    .station = std::to_string(s),
                    .reference = "self",
                    .kind = "relative",
                    .status = "localized",
                    .error_3d_m = error * (1 + 0.1 * s)});
  }
  return rows;
}

TEST(CompareErrors, PairsOursWithThePapersMode) {
  std::vector<ErrorRow> paper = Rows("g2", 1.0, 7), ours = Rows("single", 0.1, 7);
  for (const ErrorRow& row : Rows("g1", 2.0, 7)) paper.push_back(row);  // ours has no views by themselves
  ours[6].error_3d_m.reset();
  ours[6].status = "rejected";
  const auto groups = CompareErrors(paper, ours);
  ASSERT_EQ(groups.size(), 1u);
  EXPECT_EQ(groups[0].method_a, "g2");
  EXPECT_EQ(groups[0].method_b, "single");
  EXPECT_EQ(groups[0].b.answers, 6);
  EXPECT_EQ(groups[0].b.attempts, 7);
  EXPECT_EQ(groups[0].paired.b_better, 6);
  EXPECT_EQ(groups[0].paired.only_a, 1);
  EXPECT_NEAR(groups[0].paired.wilcoxon_p, 2.0 / 64, 1e-12);
  EXPECT_NEAR(*groups[0].paired.median_difference_m, 0.9 * 1.25, 1e-12);
  const std::string text = FormatComparison(groups, "paper", "ours");
  EXPECT_THAT(text, HasSubstr("ours is better than paper in 6 of 6 pairs"));
  EXPECT_THAT(text, HasSubstr("(95 % interval "));
  EXPECT_THAT(FormatComparison(CompareErrors(paper, ours, {.confidence = 0.9}), "paper", "ours"),
              HasSubstr("(90 % interval "));
  const nlohmann::json json = ComparisonJson(groups, "paper", "ours");
  EXPECT_EQ(json.at("groups").at(0).at("b_better"), 6);
  EXPECT_EQ(json.at("schema"), "trigpoint compare 1");
}

TEST(CompareErrors, SaysWhenNothingIsComparable) {
  EXPECT_TRUE(CompareErrors(Rows("g1", 1, 3), Rows("single", 1, 3)).empty());
  EXPECT_THAT(FormatComparison({}, "A", "B"), HasSubstr("no group of errors in common"));
}

}  // namespace
}  // namespace trigpoint
