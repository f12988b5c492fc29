// Predicted accuracy against what the survey states, and against errors found over simulated surveys.
#include "survey/network/network.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "survey/tags/control.h"
#include "tests/survey/yard.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

// A path around a yard, two laps of cameras looking outwards at tags on its walls; some of them known.
NetworkLayout Yard(int tags, uint64_t seed) {
  Random random(seed);
  NetworkLayout layout;
  layout.sizes.size_m = 0.3;
  const double radius = random.Uniform(4, 7);
  for (int k = 0; k < tags; ++k) {
    const double a = 2 * M_PI * (k + random.Uniform(-0.2, 0.2)) / tags;
    const double beyond = radius + random.Uniform(3, 6), up = random.Uniform(-0.5, 1.5);
    AddTagOnWall(k, a, beyond * Eigen::Vector3d(std::cos(a), std::sin(a), 0) + Eigen::Vector3d(0, 0, up), &layout);
  }
  layout.passes.push_back(Lap(48, 2.3 * M_PI, radius));
  return layout;
}

NetworkOptions Few() {
  NetworkOptions options;
  options.ties_per_image = 25;
  return options;
}

NetworkPrediction Predict(const NetworkLayout& layout, const NetworkOptions& options = Few()) {
  return PredictNetwork(layout, options, 1, 1, CancelToken());
}

SurveyResult Surveyed(const SurveyInput& input, const NetworkOptions& options = Few()) {
  ProgressSink silent;
  return SurveyTags(input, OptionsOfSurvey(options), 1, silent, CancelToken());
}

TEST(Network, StatesWhatTheSurveyWouldState) {
  for (const int ties : {0, 25}) {
    const NetworkLayout layout = Yard(9, 3);
    NetworkOptions options = Few();
    options.ties_per_image = ties;
    const NetworkPrediction predicted = Predict(layout, options);
    const SurveyResult stated = Surveyed(SimulateSurvey(layout, options, 1, nullptr), options);
    ASSERT_EQ(predicted.tags.size(), stated.tags.size());
    EXPECT_EQ(predicted.datum, stated.datum);
    for (size_t i = 0; i < stated.tags.size(); ++i) {
      EXPECT_EQ(predicted.tags[i].images, stated.tags[i].images);
      for (int k = 0; k < 6; ++k) {
        const double p = std::sqrt(predicted.tags[i].covariance(k, k)), s = std::sqrt(stated.tags[i].covariance(k, k));
        EXPECT_NEAR(p / s, 1, 0.02) << "ties " << ties << " tag " << stated.tags[i].tag_id << " component " << k;
      }
    }
  }
}

TEST(Network, WithoutKnownPointsTheFirstCameraIsTheDatum) {
  NetworkLayout layout = Yard(8, 5);
  layout.points.clear();
  const NetworkPrediction predicted = Predict(layout);
  EXPECT_EQ(predicted.datum, "first camera");
  EXPECT_FALSE(predicted.in_world);
  EXPECT_LT(BodyPrediction(predicted.bodies.front()).covariance.diagonal().maxCoeff(), 1e-9);
}

// Three points in a narrow triangle hold a survey, so they hold its prediction; two hold neither.
TEST(Network, ChoosesTheDatumAsTheSurveyDoes) {
  NetworkLayout layout = Yard(9, 3);
  const auto shift = [](double x, double y) { return Eigen::Vector3d(x, y, 0); };
  std::vector<SurveyPoint> points(layout.points.begin(), layout.points.begin() + 3);
  for (const size_t count : {2, 3}) {
    layout.points.assign(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(count));
    const NetworkPrediction predicted = Predict(layout, Few());
    const SurveyResult stated = Surveyed(SimulateSurvey(layout, Few(), 1, nullptr), Few());
    EXPECT_EQ(predicted.datum, stated.datum) << count;
    EXPECT_EQ(predicted.in_world, stated.in_world) << count;
  }
  EXPECT_TRUE(HoldAFrame({shift(0, 0), shift(10, 0), shift(5, 0.6)}));
  EXPECT_FALSE(AreWellSpread({shift(0, 0), shift(10, 0), shift(5, 0.6)}));
  EXPECT_FALSE(HoldAFrame({shift(0, 0), shift(10, 0), shift(5, 0.01), shift(2, 0)}));
}

// Over many layouts the errors found are as large as predicted.
TEST(Network, ErrorsOfSimulatedSurveysAreAsLargeAsPredicted) {
  constexpr int kLayouts = 50;
  double found = 0, predicted = 0, nees = 0;
  int coordinates = 0, surveys = 0;
  std::vector<double> ratios;
  for (int k = 0; k < kLayouts; ++k) {
    const NetworkLayout layout = Yard(8, 100 + static_cast<uint64_t>(k));
    const NetworkPrediction prediction = Predict(layout);
    Random noise(1000 + static_cast<uint64_t>(k));
    const SurveyResult result = Surveyed(SimulateSurvey(layout, Few(), 1, &noise));
    Eigen::VectorXd error(prediction.joint.rows());
    Eigen::Index row = 0;
    for (const TagPrediction& tag : prediction.tags) {
      if (!tag.tied) continue;
      for (const TagEstimate& t : result.tags) {
        if (t.tag_id != tag.tag_id) continue;
        ASSERT_TRUE(t.HasPose()) << "layout " << k << " tag " << t.tag_id << " " << t.reason;
        error.segment<3>(row) = t.world_from_tag->translation - tag.world_m;
      }
      row += 3;
    }
    ASSERT_EQ(row, error.size());
    found += error.squaredNorm();
    predicted += prediction.joint.trace();
    nees += error.dot(prediction.joint.ldlt().solve(error));
    coordinates += static_cast<int>(error.size());
    ++surveys;
    ratios.push_back(std::sqrt(error.squaredNorm() / prediction.joint.trace()));
  }
  RecordProperty("rms_found_over_predicted_percent", static_cast<int>(std::lround(100 * std::sqrt(found / predicted))));
  RecordProperty("nees_per_coordinate_percent", static_cast<int>(std::lround(100 * nees / coordinates)));
  ASSERT_EQ(surveys, kLayouts);
  // Chi-square with that many degrees of freedom, 95 %: mean 1, half width 1.96 sqrt(2 / n).
  EXPECT_NEAR(nees / coordinates, 1, 1.96 * std::sqrt(2.0 / coordinates));
  // Errors of one layout are correlated, by the datum above all: its square error counts as a few, not as 24, and their
  // scatter over layouts says how well the mean is known.
  double scatter = 0;
  for (const double ratio : ratios) scatter += std::pow(ratio * ratio - found / predicted, 2);
  EXPECT_NEAR(found / predicted, 1, 1.96 * std::sqrt(scatter / (kLayouts - 1.0) / kLayouts));
}

// Of panoramas' geotags what is common is known by their mean, and a panorama far from all points is not answered.
TEST(Network, PanoramasAreHeldByTheMeanOfTheirGeotags) {
  NetworkLayout layout = Yard(9, 3);
  for (int k = 0; k < 9; ++k) {
    const double a = 2 * M_PI * k / 9;
    PlannedPanorama panorama{std::to_string(k),
                             {Eigen::Quaterniond::Identity(), {3 * std::cos(a), 3 * std::sin(a), 0}}};
    panorama.sigma_h_m = 0.3, panorama.sigma_v_m = 0.6;
    layout.panoramas.push_back(panorama);
  }
  layout.panoramas.push_back({"far", {Eigen::Quaterniond::Identity(), {900, 0, 0}}});
  const std::vector<PanoramaPrediction> found = PredictPanoramas(layout, Few(), 1, 1, CancelToken());
  ASSERT_EQ(found.size(), 9U);
  for (const PanoramaPrediction& panorama : found) {
    const Eigen::Vector3d sigma = panorama.Sigma();
    EXPECT_GT(sigma.x(), 0.3 / 3);
    EXPECT_LT(sigma.x(), 0.3 / 3 * 1.3);  // and the common rotation and scale
    EXPECT_GT(sigma.z(), 0.6 / 3);
    EXPECT_LT(sigma.z(), 0.6 / 3 * 1.3);
  }
  layout.panoramas[0].sigma_h_m = 0.01;
  EXPECT_LT(PredictPanoramas(layout, Few(), 1, 1, CancelToken())[0].Sigma().x(), 0.01);
}

// A panorama from which the scene looks different shares points, and still cannot be matched with them.
TEST(Network, ExpectsMatchesOnlyOfMuchTheSameView) {
  NetworkLayout layout = Yard(9, 3);
  layout.panoramas = {{"near", {Eigen::Quaterniond::Identity(), {3, 0, 0}}},
                      {"facing", {Eigen::Quaterniond::Identity(), {28, 0, 0}}}};
  const auto predict = [&](const NetworkOptions& options) {
    return PredictPanoramas(layout, options, 1, 1, CancelToken());
  };
  const std::vector<PanoramaPrediction> found = predict(Few());
  ASSERT_EQ(found.size(), 2U);
  EXPECT_GT(found[0].matches, kMatchesNeeded);
  EXPECT_GE(found[1].points, kMatchesNeeded);
  EXPECT_LT(found[1].matches, kMatchesNeeded);
  NetworkOptions any = Few();
  any.match_angle_deg = 180, any.match_ratio = 1000, any.match_reach_m = 1000;
  EXPECT_GE(predict(any)[1].matches, found[1].points);
  any.match_reach_m = 10;
  EXPECT_EQ(predict(any)[1].matches, 0);
}

TEST(Network, ABlunderInAKnownPointMovesItsTagAsPredicted) {
  const NetworkLayout layout = Yard(9, 3);
  const NetworkPrediction prediction = Predict(layout);
  SurveyInput input = SimulateSurvey(layout, Few(), 1, nullptr);
  const PointPrediction& point = prediction.points.front();
  ASSERT_TRUE(point.used);
  EXPECT_GT(point.vertical.redundancy, 0);
  EXPECT_LT(point.vertical.redundancy, 1);
  input.points.front().world_m.z() += point.vertical.blunder;
  const SurveyResult moved = Surveyed(input);
  for (const TagEstimate& tag : moved.tags) {
    if (tag.tag_id != point.tag_id) continue;
    const double shift = (tag.world_from_tag->translation - layout.world_from_tag.at(tag.tag_id).translation).norm();
    EXPECT_NEAR(shift / point.vertical.effect_m, 1, 0.05);
  }
  // A point that three others outvote shows most of its error; with three in all, nothing is left to outvote it.
  NetworkLayout three = layout;
  three.points.resize(3);
  const NetworkPrediction few = Predict(three);
  EXPECT_LT(few.points.front().vertical.redundancy, 0.1);
}

TEST(Network, SuggestedControlGainsWhatIsFoundWithIt) {
  NetworkLayout layout = Yard(9, 7);
  const NetworkPrediction before = Predict(layout);
  NetworkLayout unknown = layout;
  unknown.points.clear();
  const NetworkPrediction free = Predict(unknown);
  const ControlSuggestion suggestion = SuggestControl(free, layout.points, 2, 0.01, 0.015);
  EXPECT_NEAR(before.RmsSigma() / suggestion.rms_before_m, 1, 1e-3);
  ASSERT_EQ(suggestion.tag_ids.size(), 2U);
  EXPECT_TRUE(suggestion.exact);
  EXPECT_LT(suggestion.rms_after_m, suggestion.rms_before_m);
  for (const int id : suggestion.tag_ids) {
    SurveyPoint point;
    point.name = "new " + std::to_string(id);
    point.tag_id = id;
    point.world_m = layout.world_from_tag[id].translation;
    point.sigma_h_m = 0.01;
    point.sigma_v_m = 0.015;
    layout.points.push_back(point);
  }
  EXPECT_NEAR(Predict(layout).RmsSigma() / suggestion.rms_after_m, 1, 1e-3);
  // What all candidates would give bounds any choice.
  const ControlSuggestion all = SuggestControl(free, layout.points, 100, 0.01, 0.015);
  EXPECT_LE(all.rms_after_m, suggestion.rms_after_m);
}

TEST(Network, SuggestedControlReachesADatumFirst) {
  NetworkLayout layout = Yard(8, 5);
  layout.points.clear();
  const NetworkPrediction free = Predict(layout);
  const ControlSuggestion three = SuggestControl(free, {}, 3, 0.01, 0.015);
  EXPECT_EQ(three.needed, 3U);
  ASSERT_EQ(three.tag_ids.size(), 3U);
  EXPECT_FALSE(std::isfinite(three.rms_before_m));
  EXPECT_FALSE(std::isfinite(three.rms_steps_m[1]));
  for (const int id : three.tag_ids) {
    SurveyPoint point;
    point.name = std::to_string(id), point.tag_id = id, point.world_m = layout.world_from_tag[id].translation;
    point.sigma_h_m = 0.01, point.sigma_v_m = 0.015;
    layout.points.push_back(point);
  }
  const NetworkPrediction held = Predict(layout);
  EXPECT_TRUE(held.in_world);
  EXPECT_NEAR(held.RmsSigma() / three.rms_after_m, 1, 1e-3);
  // Neither control nor check points are offered again.
  layout.points[2].role = PointRole::kCheck;
  const ControlSuggestion one = SuggestControl(free, layout.points, 1, 0.01, 0.015);
  EXPECT_EQ(one.needed, 1U);
  ASSERT_EQ(one.tag_ids.size(), 1U);
  for (const int id : three.tag_ids) EXPECT_NE(one.tag_ids.front(), id);
  // Two tags give none.
  while (layout.world_from_tag.size() > 2) layout.world_from_tag.erase(std::prev(layout.world_from_tag.end()));
  EXPECT_FALSE(SuggestControl(Predict(layout), {}, 5, 0.01, 0.015).reachable);
}

TEST(Network, WhatIsLostIsNotDetermined) {
  NetworkLayout layout = Yard(8, 5);
  const NetworkPrediction before = Predict(layout);
  layout.world_from_tag.erase(0);
  EXPECT_FALSE(std::isfinite(Predict(layout).RmsSigmaOf(before)));
  layout = Yard(8, 5);
  layout.points.clear();
  EXPECT_FALSE(std::isfinite(Predict(layout).RmsSigmaOf(before)));
  EXPECT_THAT(Predict(layout).warnings, testing::Contains(HasSubstr("relative to the first camera")));
}

// Draws of what is there do not depend on what is added, so that all additions at once bound any choice of them.
TEST(Network, AllPlacesTogetherBoundAnyChoice) {
  NetworkOptions options = Few();
  options.detected = 0.7;
  options.ties_per_image = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    NetworkLayout all = Yard(9, 500 + seed);
    NetworkLayout base = all;
    for (const int id : {3, 5, 8}) base.world_from_tag.erase(id);
    const auto sights_of_base = [&](const NetworkLayout& layout) {
      std::vector<std::pair<int, int>> seen;
      for (const PlannedSight& s : PlanSights(layout, options, seed)) {
        if (base.world_from_tag.contains(s.tag_id)) seen.emplace_back(s.frame, s.tag_id);
      }
      return seen;
    };
    EXPECT_EQ(sights_of_base(base), sights_of_base(all));
    const auto predict = [&](const NetworkLayout& layout) {
      return PredictNetwork(layout, options, seed, 1, CancelToken());
    };
    const NetworkPrediction before = predict(base);
    const double bound = predict(all).RmsSigmaOf(before);
    for (const auto& pair : {std::pair{3, 5}, std::pair{3, 8}, std::pair{5, 8}}) {
      NetworkLayout with = base;
      for (const int id : {pair.first, pair.second}) with.world_from_tag[id] = all.world_from_tag.at(id);
      EXPECT_GE(predict(with).RmsSigmaOf(before), bound * (1 - 1e-9)) << seed;
    }
  }
}

TEST(Network, SaysWhatNoPictureSees) {
  NetworkLayout layout = Yard(8, 5);
  layout.world_from_tag[99] = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 50)};
  const NetworkPrediction prediction = Predict(layout);
  EXPECT_FALSE(prediction.tags.back().tied);
  EXPECT_EQ(prediction.tags.back().images, 0);
  EXPECT_THAT(WhyUnseen(layout, Few(), 99), HasSubstr("outside every picture"));
  NetworkOptions large = Few();
  large.min_side_px = 900;
  EXPECT_THAT(WhyUnseen(layout, large, 0), HasSubstr("too small or too far"));
  layout.sizes.size_m = 0.01;
  EXPECT_THROW(Predict(layout), InputError);
}

}  // namespace
}  // namespace trigpoint
