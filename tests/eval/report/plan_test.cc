#include "eval/report/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "eval/report/trajectory_plots.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Stations at a circle's rim, each with an answer.
SceneModel Ring(int stations, double radius_m, double error_m, double sigma_m) {
  SceneModel scene;
  scene.frame = "site ENU";
  scene.on_earth = true;
  scene.runs = {"run1"};
  for (int k = 0; k < stations; ++k) {
    const double a = 2 * M_PI * k / stations;
    SceneError e;
    e.run = "run1";
    e.station = "S" + std::to_string(k);
    e.reference_position = {radius_m * std::cos(a), radius_m * std::sin(a), 0};
    e.difference = {error_m * std::cos(a), error_m * std::sin(a), 0};
    if (sigma_m > 0) e.sigma_m = Eigen::Vector3d::Constant(sigma_m);
    ScenePanorama panorama;
    panorama.station = panorama.panorama = e.station;
    panorama.world_from_pano.translation = e.reference_position + e.difference;
    scene.errors.push_back(e);
    scene.panoramas.push_back(panorama);
  }
  return scene;
}

struct Frame {
  double left = 0, right = 0, top = 0, bottom = 0;
};
Frame FrameOf(const Drawing& drawing) {
  for (const Shape& s : drawing.shapes) {
    if (s.kind == Shape::Kind::kPath && s.points.size() == 5 && s.points.front() == s.points.back())
      return {s.points[0].first, s.points[2].first, s.points[0].second, s.points[2].second};
  }
  ADD_FAILURE() << "the plan has no frame";
  return {};
}

std::vector<const Shape*> EllipsesOf(const Drawing& drawing) {
  std::vector<const Shape*> ellipses;
  for (const Shape& s : drawing.shapes) {
    if (s.dashed && s.points.size() > 10) ellipses.push_back(&s);
  }
  return ellipses;
}

// Ellipses, arrows, marks and names; the axes' numbers and the legend stand outside.
void ExpectInside(const Drawing& drawing) {
  const Frame frame = FrameOf(drawing);
  for (const Shape& s : drawing.shapes) {
    const bool mark = s.kind == Shape::Kind::kCircle || s.stroke == "#6a1b9a" || s.stroke == "#000000" ||
                      (s.fill == "#000000" && s.kind == Shape::Kind::kPath);
    if (!mark || s.points[0].second > frame.bottom + 20) continue;  // the legend's
    for (const auto& [x, y] : s.points) {
      EXPECT_GE(x, frame.left - 1e-6);
      EXPECT_LE(x, frame.right + 1e-6);
      EXPECT_GE(y, frame.top - 1e-6);
      EXPECT_LE(y, frame.bottom + 1e-6);
    }
  }
}

double HalfWidthOf(const Shape& ellipse) {
  const auto [low, high] = std::minmax_element(ellipse.points.begin(), ellipse.points.end());
  return 0.5 * (high->first - low->first);
}

std::pair<double, double> CentreOf(const Shape& ellipse) {
  const auto& p = ellipse.points.front();
  const auto& q = ellipse.points[ellipse.points.size() / 2];
  return {0.5 * (p.first + q.first), 0.5 * (p.second + q.second)};
}

TEST(PlanTest, EllipsesStayInTheFrameAndApart) {
  for (const int stations : {1, 2, 9, 40}) {
    for (const double sigma : {0.01, 0.14, 0.6}) {
      SCOPED_TRACE(testing::Message() << stations << " stations, sigma " << sigma << " m");
      const Plan plan = PlanOf(Ring(stations, 20, 0.15, sigma), {});
      ExpectInside(plan.drawing);
      const auto ellipses = EllipsesOf(plan.drawing);
      ASSERT_EQ(ellipses.size(), static_cast<size_t>(stations));
      EXPECT_THAT(plan.caption, Not(HasSubstr("Without ellipse")));
      if (stations == 1 || plan.caption.find(" 1 times enlarged") != std::string::npos) continue;
      const Frame frame = FrameOf(plan.drawing);
      double nearest = frame.right - frame.left;
      for (size_t i = 1; i < ellipses.size(); ++i) {
        const auto [x0, y0] = CentreOf(*ellipses[i - 1]);
        const auto [x1, y1] = CentreOf(*ellipses[i]);
        nearest = std::min(nearest, std::hypot(x1 - x0, y1 - y0));
      }
      EXPECT_LE(HalfWidthOf(*ellipses[0]), 0.52 * nearest);
    }
  }
}

TEST(PlanTest, SaysHowMuchItEnlarges) {
  const Plan plan = PlanOf(Ring(9, 20, 0.15, 0.14), {});
  std::vector<std::string> words;
  for (const Shape& s : plan.drawing.shapes) words.push_back(s.text);
  // Half of the 13.7 m between neighbours over 2.45 x 0.14 m: 20; what the margin allows is less.
  EXPECT_THAT(words, testing::Contains("difference x 5"));
  EXPECT_THAT(words, testing::Contains("its 95 % ellipse x 5"));
  EXPECT_THAT(plan.caption, HasSubstr("5 times enlarged"));
}

TEST(PlanTest, OneGrossErrorDoesNotShrinkTheOthers) {
  SceneModel scene = Ring(9, 20, 0.15, 0.03);
  scene.errors[0].difference = {5, 0, 0};
  scene.errors[0].sigma_m = Eigen::Vector3d::Constant(3);
  const Plan plan = PlanOf(scene, {});
  ExpectInside(plan.drawing);
  EXPECT_EQ(EllipsesOf(plan.drawing).size(), 8u);
  EXPECT_THAT(plan.caption, HasSubstr("Without ellipse or head: 1 difference that reaches too far"));
  EXPECT_THAT(plan.caption, Not(HasSubstr(" 1 times enlarged")));
}

TEST(PlanTest, NamesDoNotOverlap) {
  const Plan plan = PlanOf(Ring(40, 20, 0.15, 0.14), {});
  std::vector<DrawnBox> boxes;
  for (const Shape& s : plan.drawing.shapes) {
    if (s.kind != Shape::Kind::kText || !s.bold) continue;
    const double w = TextWidth(s.text, s.size);
    boxes.push_back({s.points[0].first - w / 2, s.points[0].second - s.size + 2, w, s.size});
  }
  EXPECT_GT(boxes.size(), 30u);
  for (size_t i = 0; i < boxes.size(); ++i) {
    for (size_t k = 0; k < i; ++k) EXPECT_FALSE(boxes[i].Overlaps(boxes[k])) << i << " " << k;
  }
}

TEST(TrajectoryPlotTest, EveryAxisHasAtLeastThreeNumbers) {
  for (const double height : {0.0, 0.07, 0.4, 1.9, 2.1, 4.9, 30.0, 1234.0}) {
    PlottedTrajectory t;
    t.name = "estimate";
    for (int k = 0; k <= 10; ++k) {
      t.places.emplace_back(k, 0.5 * k, 0.1 * height * k);
      t.reference_places.push_back(t.places.back());
      t.along.push_back(k);
      t.errors.push_back(0.1);
    }
    int numbers = 0;
    std::vector<std::string> seen;
    for (const Shape& s : TrajectoryAxesChart({t}, "m").shapes) {
      if (s.kind != Shape::Kind::kText || s.anchor != 1) continue;
      ++numbers;
      seen.push_back(s.text);
    }
    // x and y have the same numbers each time; what is left is z's.
    int others = 0;
    for (const Shape& s : TrajectoryAxesChart({t}, "m").shapes)
      others += s.kind == Shape::Kind::kText && s.anchor == 1 && s.points[0].second < 16 + 2 * 16 + 2 * 164;
    EXPECT_GE(others, 6) << height;
    EXPECT_GE(numbers - others, 3) << height;
    EXPECT_LE(numbers - others, 9) << height;
  }
}

TEST(PlanTest, CoordinatesAreInTheUnit) {
  const SceneModel scene = Ring(9, 20, 0.15, 0.14);
  const Plan metres = PlanOf(scene, {}), feet = PlanOf(scene, {"ft", 0.3048});
  // Where a coordinate's line stands, below the frame.
  const auto at = [](const Plan& plan, const std::string& text) {
    for (const Shape& s : plan.drawing.shapes) {
      if (s.text == text && s.anchor == 0) return s.points[0].first;
    }
    ADD_FAILURE() << text;
    return 0.0;
  };
  EXPECT_THAT(metres.caption, HasSubstr("(m)"));
  EXPECT_THAT(feet.caption, HasSubstr("(ft)"));
  at(metres, "east (m)"), at(feet, "north (ft)");
  const double per_metre = (at(metres, "20") - at(metres, "0")) / 20;
  EXPECT_NEAR((at(feet, "20") - at(feet, "0")) / (20 * 0.3048), per_metre, 1e-9);
}

}  // namespace
}  // namespace trigpoint
