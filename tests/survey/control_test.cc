#include "survey/tags/control.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/geo/geodetic.h"
#include "survey/tags/map_compare.h"

namespace trigpoint {
namespace {

std::vector<SurveyPoint> Points(const std::vector<Eigen::Vector3d>& places) {
  std::vector<SurveyPoint> points;
  for (const Eigen::Vector3d& place : places) {
    SurveyPoint p;
    p.name = std::to_string(points.size());
    p.tag_id = static_cast<int>(points.size());
    p.world_m = place;
    points.push_back(p);
  }
  return points;
}

TEST(Control, SpreadNeedsAnArea) {
  EXPECT_FALSE(AreWellSpread({{0, 0, 0}, {1, 0, 0}}));
  EXPECT_FALSE(AreWellSpread({{0, 0, 0}, {10, 0.1, 0}, {20, 0, 0}}));
  EXPECT_TRUE(AreWellSpread({{0, 0, 0}, {10, 0, 0}, {5, 8, 0}}));
}

TEST(Control, EveryThirdIsWithheldWhileThreeRemain) {
  std::vector<SurveyPoint> six = Points({{0, 0, 0}, {10, 0, 0}, {10, 10, 0}, {0, 10, 0}, {5, 0, 1}, {5, 5, 2}});
  EXPECT_EQ(WithholdChecks(&six), 2);
  EXPECT_EQ(six[2].role, PointRole::kCheck);
  EXPECT_EQ(six[5].role, PointRole::kCheck);
  std::vector<SurveyPoint> three = Points({{0, 0, 0}, {10, 0, 0}, {10, 10, 0}});
  EXPECT_EQ(WithholdChecks(&three), 0);
  // Without the third the others are on one line.
  std::vector<SurveyPoint> line = Points({{0, 0, 0}, {10, 0, 0}, {10, 10, 0}, {20, 0, 0}});
  EXPECT_EQ(WithholdChecks(&line), 0);
}

// Each tag's two corners stand one after the other in the table: by points alone, one would check the other.
TEST(Control, PointsOfOneTagAreOnOneSide) {
  constexpr size_t kTags = 6;
  std::vector<Eigen::Vector3d> places;
  for (size_t t = 0; t < kTags; ++t) {
    const double angle = 1.0 * static_cast<double>(t);
    places.emplace_back(10 * std::cos(angle), 10 * std::sin(angle), 1);
    places.emplace_back(10 * std::cos(angle), 10 * std::sin(angle), 1.5);
  }
  std::vector<SurveyPoint> points = Points(places);
  for (size_t i = 0; i < points.size(); ++i) {
    points[i].tag_id = static_cast<int>(i / 2);
    points[i].corner = static_cast<int>(i % 2);
  }
  EXPECT_EQ(WithholdChecks(&points), 4);
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].role, (i / 2) % 3 == 2 ? PointRole::kCheck : PointRole::kControl) << i;
  }
  // Points without a tag have nothing in common.
  for (SurveyPoint& p : points) p.tag_id = -1;
  EXPECT_EQ(WithholdChecks(&points), 4);
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].role, i % 3 == 2 ? PointRole::kCheck : PointRole::kControl) << i;
  }
}

TEST(Control, ATriangleIsOneInAnyOrder) {
  const auto expect = [](bool is_one, std::vector<Eigen::Vector3d> points) {
    std::vector<int> order = {0, 1, 2};
    do {
      const auto at = [&](size_t k) { return points[static_cast<size_t>(order[k])]; };
      EXPECT_EQ(IsTriangle(at(0), at(1), at(2)), is_one) << order[0] << order[1] << order[2];
    } while (std::next_permutation(order.begin(), order.end()));
  };
  expect(true, {{0, 0, 0}, {10, 0, 0}, {5, 0.6, 0}});
  expect(true, {{0, 0, 0}, {1, 0, 0}, {0, 10, 0}});
  expect(false, {{0, 0, 0}, {1, 0, 0}, {10, 0.5, 0}});  // 0.05 m beside a line of 10 m
  expect(false, {{0, 0, 0}, {0, 0, 0}, {10, 0, 0}});
  expect(false, {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}});
}

std::vector<TagEstimate> Map(const Rigid3d& t, double sigma) {
  std::vector<TagEstimate> tags;
  for (int i = 0; i < 6; ++i) {
    TagEstimate tag;
    tag.tag_id = i;
    tag.status = "ok";
    tag.world_from_tag = t * Rigid3d(ExpSO3({0.1 * i, 0, 0}), {3.0 * i, 1.0 * (i % 2), 0.5 * (i % 3)});
    tag.covariance = Matrix6d::Identity() * sigma * sigma;
    tags.push_back(tag);
  }
  return tags;
}

TEST(Epochs, AMovedTagIsFoundWithAndWithoutACommonDatum) {
  const Rigid3d other(ExpSO3({0, 0, 1}), {100, 20, 3});
  for (const bool same : {true, false}) {
    const std::vector<TagEstimate> before = Map({}, 0.005);
    std::vector<TagEstimate> now = Map(same ? Rigid3d() : other, 0.005);
    now[3].world_from_tag->translation += Eigen::Vector3d(0.1, 0, 0);
    const SurveyEpochs test = TestEpochs(before, now, same);
    EXPECT_EQ(test.aligned, !same);
    ASSERT_EQ(test.tags.size(), 6U);
    for (const TagChange& t : test.tags) EXPECT_EQ(t.moved, t.tag_id == 3) << t.tag_id << " " << t.chi2;
    EXPECT_NEAR(test.tags[3].shift_m.norm(), 0.1, 1e-6);
  }
  EXPECT_FALSE(TestEpochs(Map({}, 1), {}, true).problem.empty());
}

}  // namespace
}  // namespace trigpoint
