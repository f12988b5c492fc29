// Gates: intervals that cover, verdicts by the bound, nothing passed that was not evaluated.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <set>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "eval/errors/evaluation_files.h"
#include "eval/gates/gate.h"
#include "eval/gates/intervals.h"
#include "eval/gates/judge_results.h"
#include "eval/gates/measures.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/distributions.h"

namespace trigpoint {
namespace {

using nlohmann::json;
using testing::HasSubstr;

GateLimit Limit(const std::string& gate, double limit) {
  for (GateLimit g : AllGates()) {
    if (g.Gate() != gate) continue;
    g.limit = limit;
    return g;
  }
  throw OptionError("no gate " + gate);
}

Evaluation WithIntervals(double value, Interval interval) {
  Evaluation e;
  GroupSummary g{.group = {"", "single", "survey", "absolute"}};
  g.stations = 9;
  g.attempts = 9;
  g.answers = 9;
  g.error_3d.median = value;
  g.median_interval = interval;
  e.groups.push_back(g);
  return e;
}

std::vector<GateResult> JudgeEvaluation(const Evaluation& e, const std::string& gate, double limit) {
  return JudgeAll({Limit(gate, limit)}, EvaluationMeasures(json::parse(SummaryJson(e).dump()), "", 0.95));  // as read
}

TEST(Gates, DecideByTheBoundNotThePoint) {
  const auto verdict = [](double value, Interval interval) {
    return JudgeEvaluation(WithIntervals(value, interval), "evaluate.max_median_m", 0.2).at(0).verdict;
  };
  EXPECT_EQ(verdict(0.1, {0.06, 0.18}), Verdict::kPassed);
  EXPECT_EQ(verdict(0.15, {0.1, 0.25}), Verdict::kUndecided);
  EXPECT_EQ(verdict(0.25, {0.15, 0.4}), Verdict::kUndecided);
  EXPECT_EQ(verdict(0.5, {0.3, 0.8}), Verdict::kFailed);
  // The bound must come down from 0.4 to 0.2 for 0.1: half of log 4, so four times the stations.
  const GateResult r = JudgeEvaluation(WithIntervals(0.1, {0.025, 0.4}), "evaluate.max_median_m", 0.2).at(0);
  EXPECT_EQ(r.more_stations, 27);
  EXPECT_THAT(
      r.message,
      HasSubstr("undecided: evaluate.max_median_m <= 0.2 m (panorama (G2), absolute, against the tag map): 0.1 m"));
  EXPECT_THAT(r.message, HasSubstr("95 % interval 0.025 to 0.4 m, n = 9 answers"));
  EXPECT_THAT(r.message, HasSubstr("about 27 more stations"));
  const double none = std::numeric_limits<double>::infinity();
  const GateResult open = JudgeEvaluation(WithIntervals(0.1, {0.025, none}), "evaluate.max_median_m", 0.2).at(0);
  EXPECT_EQ(open.verdict, Verdict::kUndecided);
  EXPECT_THAT(open.message, HasSubstr("0.1 m, 95 % interval from 0.025 m, n = 9 answers"));
  EXPECT_THAT(FormatGates({open}), HasSubstr("from 0.025 m (95 %)"));
}

TEST(Gates, WhatWasNotEvaluatedIsUndecided) {
  Evaluation e = WithIntervals(0.1, {0.05, 0.15});
  e.groups[0].median_interval.reset();
  EXPECT_EQ(JudgeEvaluation(e, "evaluate.max_median_m", 0.2).at(0).verdict, Verdict::kUndecided);
  EXPECT_EQ(JudgeEvaluation(e, "evaluate.max_p90_m", 1).at(0).verdict, Verdict::kUndecided);
  e.groups.clear();
  EXPECT_EQ(JudgeEvaluation(e, "evaluate.max_median_m", 0.2).at(0).verdict, Verdict::kUndecided);
  // Each gate there is, held against empty results of every stage.
  std::vector<GateMeasure> measures = EvaluationMeasures({}, "", 0.95);
  for (const auto& more : {SurveyMeasures({}, {}, 0.95), LocalizeMeasures("run1", {}, 0.95), EstimateMeasures({}, ""),
                           StitchMeasures("set", {}), CalibrationMeasures("cam", {})}) {
    measures.insert(measures.end(), more.begin(), more.end());
  }
  std::vector<GateLimit> limits;
  for (const GateLimit& gate : AllGates()) limits.push_back(Limit(gate.Gate(), 1));
  const std::vector<GateResult> results = JudgeAll(limits, measures);
  EXPECT_GE(results.size(), limits.size());
  for (const GateResult& r : results) {
    // Not one check point is a count, and fewer than the limit.
    const bool counted = r.limit.Gate() == "survey.min_check_points";
    EXPECT_EQ(r.verdict, counted ? Verdict::kFailed : Verdict::kUndecided) << r.message;
  }
  EXPECT_EQ(OverallVerdict({}), Verdict::kUndecided);
}

// The first evaluation shows the cameras of all variants beside each other; each variant has gates of its own.
TEST(Gates, CamerasOfOtherVariantsAreNotJudged) {
  json estimates = {{"estimates", json::array()}};
  for (const char* system : {"trigpoint", "trigpoint@paper", "trigpoint@site", "slam"})
    estimates["estimates"].push_back({{"system", system}, {"run", "run1"}, {"attempts", 10}, {"answers", 9}});
  const auto judged = [&](const std::string& variant) {
    std::set<std::string> subjects;
    for (const GateMeasure& measure : EstimateMeasures(estimates, variant)) subjects.insert(measure.subject);
    return subjects;
  };
  EXPECT_EQ(judged(""), (std::set<std::string>{"trigpoint on run1", "slam on run1"}));
  EXPECT_EQ(judged("paper"), (std::set<std::string>{"trigpoint@paper on run1", "slam on run1"}));
}

TEST(Gates, AnsweredShareCountsStations) {
  Evaluation e = WithIntervals(0.1, {0.05, 0.15});
  const auto verdict = [&](double limit) { return JudgeEvaluation(e, "evaluate.min_answered", limit).at(0).verdict; };
  EXPECT_EQ(verdict(0.6), Verdict::kPassed);
  EXPECT_EQ(verdict(0.9), Verdict::kUndecided);
  e.groups[0].answers = 1;
  EXPECT_EQ(verdict(0.9), Verdict::kFailed);
}

// Clopper and Pearson: 0 and 10 of 10, and 4 of 10 as tabulated.
TEST(Intervals, OfAShare) {
  EXPECT_NEAR(ShareInterval(0, 10, 0.95).high, 0.30850, 1e-5);
  EXPECT_EQ(ShareInterval(0, 10, 0.95).low, 0);
  EXPECT_NEAR(ShareInterval(1, 10, 0.95).low, 0.69150, 1e-5);
  EXPECT_NEAR(ShareInterval(0.4, 10, 0.95).low, 0.12155, 1e-5);
  EXPECT_NEAR(ShareInterval(0.4, 10, 0.95).high, 0.73762, 1e-5);
  // Exactly: every possible outcome, weighted by its probability.
  for (const double p : {0.05, 0.3, 0.5, 0.9, 0.99}) {
    for (const int n : {5, 9, 30}) {
      double covered = 0;
      for (int k = 0; k <= n; ++k) {
        const Interval i = ShareInterval(static_cast<double>(k) / n, n, 0.95);
        if (p >= i.low && p <= i.high) covered += BinomialCdf(k, n, p) - BinomialCdf(k - 1, n, p);
      }
      EXPECT_GE(covered, 0.95) << p << " " << n;
    }
  }
}

// The interval of an RMSE covers the true one: alike components, one component that dominates, and one alone.
TEST(Intervals, OfAnRmseCover) {
  Random random(4);
  constexpr int kDraws = 4000;
  for (const std::vector<double>& sigmas :
       {std::vector<double>{1, 1}, std::vector<double>{1, 1, 3}, std::vector<double>{1}}) {
    double truth = 0;
    for (const double s : sigmas) truth += s * s;
    for (const int n : {3, 6, 30}) {
      int covered = 0;
      for (int d = 0; d < kDraws; ++d) {
        std::vector<std::vector<double>> components(sigmas.size());
        for (size_t k = 0; k < sigmas.size(); ++k) {
          for (int i = 0; i < n; ++i) components[k].push_back(sigmas[k] * random.Normal());
        }
        const auto rmse = RmseWithInterval(components, 0.95);
        ASSERT_TRUE(rmse);
        covered += rmse->interval.low <= std::sqrt(truth) && std::sqrt(truth) <= rmse->interval.high;
      }
      // 0.95 within four sigma of so many draws; few items of several components may cover more, never less.
      EXPECT_GT(covered, 0.936 * kDraws) << sigmas.size() << " components, n = " << n;
      if (sigmas.size() == 1) {
        EXPECT_LT(covered, 0.964 * kDraws) << "n = " << n;
      }
    }
  }
  EXPECT_FALSE(RmseWithInterval({{0.1, 0.2}}, 0.95));
}

json SurveyWith(const std::vector<Eigen::Vector3d>& residuals) {
  json summary = {{"points", json::array()},
                  {"check", {{"check_points_sigma_h_m", 0.0}, {"check_points_sigma_v_m", 0.0}}}};
  for (const Eigen::Vector3d& r : residuals) {
    summary["points"].push_back({{"name", "P"},
                                 {"role", "check"},
                                 {"checked", true},
                                 {"map_minus_stated_m", {r.x(), r.y(), r.z()}},
                                 {"chi2_3dof", r.squaredNorm() / 1e-4}});
  }
  return summary;
}

// A limit exactly at the true RMSE: every verdict that is passed is wrong, and so is every one that is failed.
TEST(Gates, CheckRmseIsWrongInAtMostFivePercent) {
  Random random(5);
  int passed = 0, failed = 0;
  constexpr int kDraws = 2000;
  for (int d = 0; d < kDraws; ++d) {
    std::vector<Eigen::Vector3d> residuals;
    for (int i = 0; i < 8; ++i)
      residuals.emplace_back(0.01 * random.Normal(), 0.01 * random.Normal(), 0.02 * random.Normal());
    const GateResult r = JudgeAll({Limit("survey.max_check_rmse_3d_m", 0.01 * std::sqrt(6.0))},
                                  SurveyMeasures(SurveyWith(residuals), {}, 0.95))
                             .at(0);
    passed += r.verdict == Verdict::kPassed;
    failed += r.verdict == Verdict::kFailed;
  }
  EXPECT_LE(passed, kDraws / 25);
  EXPECT_LE(failed, kDraws / 25);
  EXPECT_GT(passed + failed, kDraws / 200);
}

// A limit exactly at the true median: every verdict that is passed is wrong, and rare.
TEST(Gates, MedianIsPassedWronglyInAtMostFivePercent) {
  Random random(8);
  int wrong = 0;
  constexpr int kCampaigns = 200;
  for (int c = 0; c < kCampaigns; ++c) {
    std::vector<ClusteredValue> errors;
    std::vector<double> station(9), run(3), values;
    for (double& v : station) v = 0.5 * random.Normal();
    for (double& v : run) v = 0.3 * random.Normal();
    for (int i = 0; i < 27; ++i) {
      const double y = station[static_cast<size_t>(i % 9)] + run[static_cast<size_t>(i / 9)] + 0.5 * random.Normal();
      errors.push_back({0.2 * std::exp(y), i % 9, i / 9});
      values.push_back(errors.back().value);
    }
    const auto interval = ClusteredQuantileInterval(errors, 0.5, {.samples = 300});
    ASSERT_TRUE(interval);
    const Evaluation e = WithIntervals(Summarize(values, 0).median.value(), *interval);
    wrong += JudgeEvaluation(e, "evaluate.max_median_m", 0.2).at(0).verdict == Verdict::kPassed;
  }
  EXPECT_LE(wrong, kCampaigns / 20);
}

// Stated sigmas that are right, and half of what they should be, of 9 answers in space.
TEST(Gates, ConsistencyByChiSquare) {
  Random random(6);
  int right_failed = 0, half_failed = 0;
  constexpr int kDraws = 500;
  for (int d = 0; d < kDraws; ++d) {
    double nees = 0;
    for (int i = 0; i < 27; ++i) nees += std::pow(random.Normal(), 2);
    Evaluation e = WithIntervals(0.1, {0.05, 0.15});
    const auto failed = [&](double factor) {
      e.groups[0].nees_joint = NeesSummary{9, 27, factor * nees};
      return JudgeEvaluation(e, "localize.max_nees_per_dof", 1).at(0).verdict == Verdict::kFailed;
    };
    right_failed += failed(1), half_failed += failed(4);
  }
  EXPECT_LE(right_failed, 0.045 * kDraws);  // 2.5 % and three sigma of the draws
  EXPECT_GE(half_failed, 0.95 * kDraws);
}

TEST(Gates, CompleteValuesNeedNoInterval) {
  TagResult tag;
  tag.tag_id = 3;
  tag.map_from_tag = Rigid3d();
  tag.sigma_m = Eigen::Vector3d(0.001, 0.004, 0.002);
  const auto judge = [&](const std::vector<TagResult>& tags, double limit) {
    return JudgeAll({Limit("survey.max_tag_sigma_m", limit)}, SurveyMeasures(json::object(), tags, 0.95)).at(0);
  };
  EXPECT_EQ(judge({tag}, 0.005).verdict, Verdict::kPassed);
  EXPECT_EQ(judge({tag}, 0.003).verdict, Verdict::kFailed);
  EXPECT_THAT(judge({tag}, 0.003).message, HasSubstr("tag 3"));
  TagResult lost;
  lost.tag_id = 8;
  EXPECT_EQ(judge({tag, lost}, 0.005).verdict, Verdict::kUndecided);
  EXPECT_THAT(judge({tag, lost}, 0.005).message, HasSubstr("no place was found for tag 8"));
}

TEST(GateLimits, AreReadAsPeopleWriteThem) {
  std::vector<std::string> problems;
  const json written = {{"max-median", 0.2}, {"survey", {{"max_tag_sigma", 0.01}}}};
  const GateLimits limits = ReadLimits(written, "gates", &problems);
  EXPECT_TRUE(problems.empty());
  EXPECT_EQ(limits.evaluate.max_median_m, 0.2);
  EXPECT_EQ(limits.survey.max_tag_sigma_m, 0.01);
  EXPECT_EQ(JudgedStages(limits), (std::set<std::string>{"evaluate", "survey"}));
  ReadLimits(json{{"max_medain", 0.2}}, "gates", &problems);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems[0], HasSubstr("gates: unknown gate 'max_medain'; nearest known one: 'max_median_m'"));
}

}  // namespace
}  // namespace trigpoint
