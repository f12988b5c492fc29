// The map of a plan: names and marks keep apart, the legend names what is there.
#include "eval/plan/map.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <set>

#include "eval/scene/scene_model.h"

namespace trigpoint {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;

Matrix6d Covariance(double sigma_m) { return sigma_m * sigma_m * Matrix6d::Identity(); }

void AddTag(int id, const Eigen::Vector3d& place, const std::string& role, bool tied, PlanFindings* findings) {
  TagPrediction& tag = findings->prediction.tags.emplace_back();
  tag.tag_id = id, tag.world_m = place, tag.role = role, tag.tied = tied;
  if (tied) tag.covariance = Covariance(0.01);
  findings->layout.network.world_from_tag[id].translation = place;
}

// Thirty tags, in pairs 0.6 m apart, and a path between them.
PlanFindings Crowded() {
  PlanFindings findings;
  findings.prediction.in_world = true;
  for (int id = 0; id < 30; ++id) {
    const double x = 4.0 * (id / 2 % 5) + 0.6 * (id % 2), y = 4.0 * (id / 10);
    AddTag(id, {x, y, 1}, id % 7 == 0 ? "control" : "free", id != 3, &findings);
  }
  findings.layout.network.passes.resize(1);
  findings.layout.network.passes[0].name = "monday";
  for (int k = 0; k < 40; ++k) {
    BodyPrediction& body = findings.prediction.bodies.emplace_back();
    body.world_from_body.translation = {0.5 * k, 2.0, 1};
    body.covariance = Covariance(0.012);
  }
  findings.layout.stations.push_back({"S9", 9, Eigen::Vector3d(0, 0, 1), 0.01});
  findings.suggestions.push_back({"a tag", 0, Eigen::Vector3d(10, 2, 1), 0.5});
  return findings;
}

std::set<std::string> TextsOf(const Drawing& drawing) {
  std::set<std::string> texts;
  for (const Shape& s : drawing.shapes) {
    if (s.kind == Shape::Kind::kText) texts.insert(s.text);
  }
  return texts;
}

DrawnBox BoxOf(const Shape& text) {
  const double w = TextWidth(text.text, text.size), x = text.points[0].first;
  return {text.anchor < 0    ? x
          : text.anchor == 0 ? x - w / 2
                             : x - w,
          text.points[0].second - 0.75 * text.size, w, 0.75 * text.size};
}

TEST(PlanMap, NamesCoverNeitherEachOtherNorMarksNorEllipses) {
  const Drawing map = PlanMap(Crowded());
  std::vector<DrawnBox> names;
  for (const Shape& s : map.shapes) {
    if (s.kind != Shape::Kind::kText || s.fill == "#ffffff") continue;  // white: the number in its own disc
    const DrawnBox box = BoxOf(s);
    EXPECT_GE(box.x, 0) << s.text;
    EXPECT_LE(box.x + box.width, map.width) << s.text;
    EXPECT_LE(box.y + box.height, map.height) << s.text;
    for (const DrawnBox& other : names) EXPECT_FALSE(box.Overlaps(other)) << s.text;
    names.push_back(box);
  }
  EXPECT_GE(names.size(), 30U);
  for (const Shape& s : map.shapes) {
    // Tags' ellipses and strokes are of this width or more; the path's may be covered.
    const bool obstacle = s.kind == Shape::Kind::kCircle || (s.kind == Shape::Kind::kPath && s.width >= 1.6);
    if (!obstacle || s.fill == "#ffffff" || (s.points.size() == 4 && s.opacity < 1)) continue;
    for (const auto& [x, y] : s.points) {
      const double r = s.radius;
      for (const DrawnBox& name : names) EXPECT_FALSE(name.Overlaps({x - r, y - r, 2 * r, 2 * r})) << x << ", " << y;
    }
  }
  // Ellipses of neighbours keep apart, and those along the path: it has 40 poses half a metre apart.
  std::vector<const Shape*> ellipses;
  for (const Shape& s : map.shapes) {
    if (s.points.size() == 49) ellipses.push_back(&s);
  }
  ASSERT_GT(ellipses.size(), 30U);
  const auto bounds = [](const Shape& s) {
    const auto [left, right] = std::minmax_element(s.points.begin(), s.points.end());
    const double r = 0.5 * (right->first - left->first) - 0.01;
    return DrawnBox{left->first, left->second - r, 2 * r, 2 * r};
  };
  for (size_t i = 0; i < ellipses.size(); ++i) {
    for (size_t k = 0; k < i; ++k) EXPECT_FALSE(bounds(*ellipses[i]).Overlaps(bounds(*ellipses[k]))) << i << " " << k;
  }
}

TEST(PlanMap, LegendNamesWhatIsThere) {
  EXPECT_THAT(TextsOf(PlanMap(Crowded())),
              IsSupersetOf({"control", "tag", "tag in no planned picture", "station", "planned path",
                            "suggested place; arrow: the way it faces", "N", "monday", "S9"}));
  PlanFindings few;
  few.prediction.in_world = true;
  AddTag(4, {0, 0, 1}, "free", true, &few);
  AddTag(5, {3, 1, 1}, "free", true, &few);
  const MapWords words = {"tag seen", "tag planned, not seen yet", "camera path", "photograph next"};
  const std::set<std::string> texts = TextsOf(PlanMap(few, words));
  EXPECT_THAT(texts, Contains("tag seen"));
  for (const char* absent : {"control", "station", "camera path", "photograph next", "tag planned, not seen yet"}) {
    EXPECT_THAT(texts, Not(Contains(absent)));
  }
}

TEST(PlanMap, TheScaleTakesTheUnit) {
  const auto scale_of = [](const MapWords& words) {
    for (const std::string& text : TextsOf(PlanMap(Crowded(), words))) {
      if (!text.empty() && text.ends_with(" " + words.unit.name)) return text;
    }
    return std::string();
  };
  MapWords words;
  const double metres = std::stod(scale_of(words));
  words.unit = {"ft", 0.3048};
  const double feet = std::stod(scale_of(words));
  EXPECT_GT(0.3048 * feet, 0.4 * metres);  // the round length below a quarter of the width
  EXPECT_LT(0.3048 * feet, 2.5 * metres);
}

// Stations beside their tags, in a cluster: names that find no place beside their marks get a line to them.
TEST(PlanMap, EveryTagAndStationHasAName) {
  std::set<std::string> names;
  PlanFindings crowded = Crowded();
  for (int id = 0; id < 30; ++id) {
    const std::string station = fmt::format("S{}", id);
    names.insert({std::to_string(id), station});
    if (id != 9) crowded.layout.stations.push_back({station, id, Eigen::Vector3d(0, 0, 1), 0.01});
  }
  const std::set<std::string> texts = TextsOf(PlanMap(crowded));
  EXPECT_THAT(texts, IsSupersetOf(names));
  EXPECT_THAT(texts, Not(Contains(HasSubstr("left out"))));
}

TEST(PlanMap, NorthIsDrawnOnlyWhereItIsKnown) {
  PlanFindings findings = Crowded();
  findings.prediction.in_world = false;
  findings.prediction.datum = "first camera";
  const std::set<std::string> texts = TextsOf(PlanMap(findings));
  EXPECT_THAT(texts, Not(Contains("N")));
  EXPECT_THAT(texts, IsSupersetOf({"x", "y", "axes of the first camera"}));
}

TEST(PlanMap, NamesThatFindNoPlaceAreCounted) {
  PlanFindings findings;
  for (int id = 0; id < 80; ++id) AddTag(id, {0.05 * (id % 9), 0.05 * (id / 9), 1}, "free", true, &findings);
  AddTag(200, {30, 20, 1}, "control", true, &findings);
  const std::set<std::string> texts = TextsOf(PlanMap(findings));
  EXPECT_THAT(texts, Contains("200"));
  EXPECT_THAT(texts, Contains(HasSubstr("names left out for want of room")));
}

// Station centres are inside the ellipses of their tags: names go beside these, without a line across.
TEST(PlanMap, NamesOfStationsFindARoomOnAnEmptyMap) {
  PlanFindings findings;
  for (int id = 100; id < 109; ++id) {
    const double a = 2 * M_PI * (id - 100) / 9;
    AddTag(id, {20 * std::cos(a), 12 * std::sin(a), 1}, "free", true, &findings);
    findings.layout.stations.push_back({fmt::format("S{}", id), id, Eigen::Vector3d(0, 0, 1), 0.01});
  }
  const Drawing map = PlanMap(findings);
  EXPECT_THAT(TextsOf(map), Not(Contains(HasSubstr("left out"))));
  for (const Shape& s : map.shapes) EXPECT_NE(s.width, 0.8) << "a line to a name at " << s.points.front().first;
}

PlanGain Gain(const std::string& kind, double rms_m, const Eigen::Vector3d& at) {
  PlanGain gain{kind, rms_m, at};
  gain.kind = kind;
  return gain;
}

// White numbers in discs.
std::set<std::string> NumbersOf(const Drawing& drawing) {
  std::set<std::string> numbers;
  for (const Shape& s : drawing.shapes) {
    if (s.kind == Shape::Kind::kText && s.fill == "#ffffff") numbers.insert(s.text);
  }
  return numbers;
}

TEST(PlanMap, BestGainsHaveTheirRankWithoutSuggestions) {
  PlanFindings findings;
  findings.prediction.in_world = true;
  AddTag(100, {0, 0, 1}, "free", true, &findings);
  AddTag(101, {20, 10, 1}, "free", true, &findings);
  findings.prediction.joint = 1e-4 * Eigen::MatrixXd::Identity(6, 6);  // RMS 17.3 mm
  findings.gains = {Gain("control", 0.010, {0, 0, 1}),
                    Gain("tags", 0.011, {5, 2, 1}),
                    Gain("tags", 0.012, {8, 2, 1}),
                    Gain("tags", 0.013, {11, 2, 1}),
                    Gain("tags", 0.014, {14, 2, 1}),
                    Gain("path", 0.015, {0, 0, 0}),
                    Gain("path", 0.1 * std::sqrt(0.03), {2, 2, 2})};
  for (const size_t k : {5, 6}) {
    findings.gains[k].world_m.reset();
    findings.gains[k].way_m = {{0, 5, 1}, {10, 5, 1}, {20, 5, 1}};
  }
  const Drawing map = PlanMap(findings);
  // Of each kind the best three; "1" is in the legend, too; the last gains nothing.
  EXPECT_EQ(NumbersOf(map), (std::set<std::string>{"1", "2", "3", "4", "6"}));
  EXPECT_THAT(TextsOf(map),
              IsSupersetOf({"one more tag, control or pass: its rank by gain", "pass not planned yet", "100", "101"}));
  findings.suggestions = {Gain("tags", 0.012, {8, 2, 1})};
  EXPECT_EQ(NumbersOf(PlanMap(findings)), std::set<std::string>{"1"});
  EXPECT_THAT(TextsOf(PlanMap(findings)), Contains("suggested place; arrow: the way it faces"));
}

double Luminance(const std::array<double, 3>& rgb) {
  double sum = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double c = rgb[k] / 255;
    sum += std::array{0.2126, 0.7152, 0.0722}[k] * (c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  }
  return sum;
}
double LuminanceOf(const std::string& colour) {
  const auto channel = [&](size_t k) { return std::stoi(colour.substr(1 + 2 * k, 2), nullptr, 16); };
  return Luminance({1.0 * channel(0), 1.0 * channel(1), 1.0 * channel(2)});
}

// The worst picture is black.
TEST(PlanMap, LinesAndNamesStandOutOnTheAerialImage) {
  PlanFindings findings = Crowded();
  SceneAerial aerial;
  aerial.picture = cv::Mat(40, 60, CV_8UC3, cv::Scalar(0, 0, 0));
  aerial.columns = aerial.rows = 2;
  aerial.vertices = {{-100, 100, 0}, {100, 100, 0}, {-100, -100, 0}, {100, -100, 0}};
  findings.aerial = std::make_shared<const SceneAerial>(aerial);
  const Drawing map = PlanMap(findings);
  const Shape& picture = map.shapes.at(1);
  ASSERT_EQ(picture.kind, Shape::Kind::kPicture);
  const std::vector<uchar> bytes(picture.picture->begin(), picture.picture->end());
  double darkest = 0, brightest = 0;
  cv::minMaxLoc(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE), &darkest, &brightest);
  EXPECT_LT(brightest, 170);  // all of it is the image
  int names = 0;
  for (size_t i = 2; i < map.shapes.size(); ++i) {
    const Shape &s = map.shapes[i], &before = map.shapes[i - 1];
    if (s.points.front().second >= picture.extent.second) break;  // the legend, on white
    if (s.kind == Shape::Kind::kText && s.fill != "#ffffff") {
      ++names;
      ASSERT_EQ(before.fill, "#ffffff") << s.text;
      const double paper = before.opacity * 255 + (1 - before.opacity) * darkest;
      EXPECT_GE((Luminance({paper, paper, paper}) + 0.05) / (LuminanceOf(s.fill) + 0.05), 4.5) << s.text;
    } else if (s.kind == Shape::Kind::kPath && !s.stroke.empty() && s.stroke != "#ffffff") {
      EXPECT_EQ(before.stroke, "#ffffff");
      EXPECT_GT(before.width, s.width + 2);
    }
  }
  EXPECT_GE(names, 30);
}

TEST(PlanMap, ColoursAreReadableOnWhite) {
  for (const Shape& s : PlanMap(Crowded()).shapes) {
    for (const std::string& colour : {s.stroke, s.fill}) {
      if (colour.empty() || colour == "#ffffff" || colour == "#d5dade") continue;  // paper; a rule that separates
      EXPECT_GE(1.05 / (LuminanceOf(colour) + 0.05), 4.5) << colour;
    }
  }
}

}  // namespace
}  // namespace trigpoint
