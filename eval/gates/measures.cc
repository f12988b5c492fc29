#include "eval/gates/measures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "eval/gates/intervals.h"
#include "eval/statistics/distributions.h"
#include "eval/text/json_values.h"
#include "eval/text/method_name.h"
#include "eval/trajectory/estimates.h"
#include "eval/trajectory/score_estimates.h"

namespace trigpoint {
namespace {

using nlohmann::json;

int CountAt(const json& value, std::initializer_list<const char*> path) {
  return static_cast<int>(At(value, path).value_or(0));
}

// A value that needs no inference.
GateMeasure Complete(const std::string& gate, const std::string& subject, const std::optional<double>& value, int n,
                     const std::string& counted, const std::string& reason) {
  GateMeasure m{.gate = gate, .subject = subject, .value = value, .complete = value.has_value(), .n = n};
  m.counted = counted;
  if (!value) m.reason = reason;
  return m;
}

// An end that is not known is infinite; nothing where neither is.
std::optional<Interval> OpenIntervalAt(const json& group, const char* key) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const auto ends = EndsAt(group, key);
  if (!ends || (!ends->low && !ends->high)) return std::nullopt;
  return Interval{ends->low.value_or(-kNone), ends->high.value_or(kNone)};
}

void AddPercentile(const json& group, const char* name, const char* value, const char* interval, double confidence,
                   const GateMeasure& base, std::vector<GateMeasure>* measures) {
  GateMeasure m = base;
  m.gate = std::string("evaluate.") + name;
  m.value = At(group, {"error_3d", "over_answers", value});
  m.interval = OpenIntervalAt(group, interval);
  m.confidence = confidence;
  m.n = CountAt(group, {"answers"});
  m.counted = "answers";
  if (!m.value) m.reason = "no answer with a reference";
  if (m.value && !m.interval) m.reason = "too few answers for an interval";
  m.design = GateDesign{CountAt(group, {"stations"}), CountAt(group, {"runs"}), m.n,
                        At(group, {"variance_shares", "station"}).value_or(0),
                        At(group, {"variance_shares", "run"}).value_or(0)};
  measures->push_back(std::move(m));
}

void AddAnswered(const json& group, double confidence, const GateMeasure& base, std::vector<GateMeasure>* measures) {
  GateMeasure m = base;
  m.gate = "evaluate.min_answered";
  const int attempts = CountAt(group, {"attempts"}), stations = CountAt(group, {"stations"});
  m.n = std::min(attempts, stations);
  m.counted = "stations";
  m.reason = m.n > 0 ? "" : "no attempt";
  if (m.n > 0) {
    m.value = static_cast<double>(CountAt(group, {"answers"})) / attempts;
    // A station that cannot be answered is so in every run: no more independent trials than stations.
    m.interval = ShareInterval(*m.value, m.n, confidence);
    m.confidence = confidence;
    m.design = GateDesign{stations, 1, attempts, 1, 0, false, true};
  }
  measures->push_back(std::move(m));
}

// The factor on the stated covariances that would explain the errors: their normalised sum is chi-square.
void AddConsistency(const json& group, double confidence, const GateMeasure& base, std::vector<GateMeasure>* measures) {
  GateMeasure m = base;
  m.gate = "localize.max_nees_per_dof";
  m.value = At(group, {"nees", "joint", "mean_per_dof"});
  m.n = CountAt(group, {"nees", "joint", "count"});
  m.counted = "answers";
  const double dof = At(group, {"nees", "joint", "dof"}).value_or(0);
  if (m.value && dof >= kLeastForRmse) {
    m.interval = Interval{*m.value * dof / ChiSquareQuantile(0.5 * (1 + confidence), dof),
                          *m.value * dof / ChiSquareQuantile(0.5 * (1 - confidence), dof)};
    m.confidence = confidence;
  } else {
    m.reason = m.value ? "too few answers for an interval" : "no joint covariance of answers and reference";
  }
  measures->push_back(std::move(m));
}

// Residuals of check points as summary.json lists them.
struct Check {
  std::vector<double> e, n, u;
};

Check CheckResiduals(const json& summary) {
  Check check;
  for (const json& point : ListAt(summary, "points")) {
    const json& d = ListAt(point, "map_minus_stated_m");
    if (!FlagAt(point, "checked") || d.size() != 3) continue;
    check.e.push_back(d[0]), check.n.push_back(d[1]), check.u.push_back(d[2]);
  }
  return check;
}

void AddCheck(const json& summary, double confidence, std::vector<GateMeasure>* measures) {
  const Check check = CheckResiduals(summary);
  const int n = static_cast<int>(check.e.size());
  const double own_h = At(summary, {"check", "check_points_sigma_h_m"}).value_or(0);
  const double own_v = At(summary, {"check", "check_points_sigma_v_m"}).value_or(0);
  const auto add = [&](const char* name, const std::vector<std::vector<double>>& components, double own) {
    GateMeasure m{.gate = std::string("survey.") + name, .n = n, .counted = "check points"};
    const auto rmse = RmseWithInterval(components, confidence);
    double sum = 0;
    for (const auto& component : components)
      for (const double e : component) sum += e * e;
    if (n > 0) m.value = std::hypot(std::sqrt(sum / n), own);
    if (rmse) {
      m.interval = Interval{std::hypot(rmse->interval.low, own), std::hypot(rmse->interval.high, own)};
      m.confidence = confidence;
    } else {
      m.reason = n == 0 ? "the map has no check point"
                        : fmt::format("too few check points for an interval: expected at least {}", kLeastForRmse);
    }
    measures->push_back(std::move(m));
  };
  add("max_check_rmse_h_m", {check.e, check.n}, own_h);
  add("max_check_rmse_v_m", {check.u}, own_v);
  add("max_check_rmse_3d_m", {check.e, check.n, check.u}, std::hypot(own_h, own_v));
  measures->push_back(Complete("survey.min_check_points", "", n, n, "check points", ""));
}

void AddResiduals(const json& summary, std::vector<GateMeasure>* measures) {
  std::optional<double> largest;
  int n = 0;
  std::string of;
  const auto take = [&](double value, const std::string& name) {
    ++n;
    if (largest && value <= *largest) return;
    largest = value;
    of = name;
  };
  for (const json& point : ListAt(summary, "points")) {
    const auto chi2 = At(point, {"chi2_3dof"});
    if (chi2 && TextAt(point, "role") != "geotag") take(std::sqrt(std::max(0.0, *chi2)), TextAt(point, "name"));
  }
  for (const json& d : ListAt(summary, "distances")) {
    const auto measured = At(d, {"measured_m"}), map = At(d, {"map_m"}), sigma = At(d, {"sigma_m"});
    if (!measured || !map || !sigma || !(*sigma > 0)) continue;
    take(std::abs(*map - *measured) / *sigma, fmt::format("distance {}-{}", CountAt(d, {"from"}), CountAt(d, {"to"})));
  }
  GateMeasure m = Complete("survey.max_standardised_residual", "", largest, n, "points and distances",
                           "no surveyed point and no distance");
  if (largest) m.note = "the largest is that of " + of;
  measures->push_back(std::move(m));
}

void AddTags(const std::vector<TagResult>& tags, std::vector<GateMeasure>* measures) {
  std::optional<double> largest;
  std::string unplaced, of;
  for (const TagResult& tag : tags) {
    if (!tag.map_from_tag || !tag.sigma_m) {
      unplaced += (unplaced.empty() ? "" : ", ") + std::to_string(tag.tag_id);
    } else if (const double sigma = tag.sigma_m->maxCoeff(); !largest || sigma > *largest) {
      largest = sigma;
      of = std::to_string(tag.tag_id);
    }
  }
  GateMeasure m = Complete("survey.max_tag_sigma_m", "", largest, static_cast<int>(tags.size()), "tags", "no tag");
  if (largest) m.note = "the largest is that of tag " + of;
  if (!unplaced.empty()) {
    m.complete = false;
    m.reason = "no place was found for tag " + unplaced;
  }
  measures->push_back(std::move(m));
}

}  // namespace

std::vector<GateMeasure> EvaluationMeasures(const json& summary, const std::string& variant, double confidence) {
  std::vector<GateMeasure> measures;
  const json& groups = ListAt(summary, "groups");
  const auto own = [&](const json& g) { return TextAt(g, "variant") == variant && TextAt(g, "method") != "g1"; };
  const auto attempted = [](const json& g) { return CountAt(g, {"attempts"}) > 0; };
  const bool independent = std::any_of(groups.begin(), groups.end(), [&](const json& g) {
    return own(g) && !FlagAt(g, "shares_evidence") && attempted(g);
  });
  const double its_confidence = At(summary, {"confidence"}).value_or(confidence);
  for (const json& group : groups) {
    const bool shares = FlagAt(group, "shares_evidence");
    if (!own(group) || !attempted(group) || (independent && shares)) continue;
    GateMeasure base;
    base.subject = MethodName(TextAt(group, "method")) + ", " + TextAt(group, "kind") + ", against " +
                   ReferenceName(TextAt(group, "reference"));
    if (shares) base.note = "agreement: the reference shares evidence with the runs";
    AddPercentile(group, "max_median_m", "median_m", "median_interval_m", its_confidence, base, &measures);
    AddPercentile(group, "max_p90_m", "p90_m", "p90_interval_m", its_confidence, base, &measures);
    AddAnswered(group, confidence, base, &measures);
    AddConsistency(group, confidence, base, &measures);
  }
  return measures;
}

std::vector<GateMeasure> SurveyMeasures(const json& summary, const std::vector<TagResult>& tags, double confidence) {
  std::vector<GateMeasure> measures;
  AddCheck(summary, confidence, &measures);
  AddResiduals(summary, &measures);
  AddTags(tags, &measures);
  GateMeasure m{.gate = "survey.max_repeatability_m"};
  m.value = At(summary, {"repeatability", "rms_m"});
  m.n = CountAt(summary, {"repeatability", "maps"});
  m.counted = "maps";
  if (CountAt(summary, {"repeatability", "differences"}) == 0) m.value.reset();
  if (m.value && m.n >= 2) {
    // Tags of one map share its error, and the maps' differences from the map of all runs sum to zero.
    m.interval = RmsInterval(*m.value, 3.0 * (m.n - 1), confidence);
    m.confidence = confidence;
  } else {
    m.reason = "fewer than two runs that can be mapped by themselves";
  }
  measures.push_back(std::move(m));
  return measures;
}

std::vector<GateMeasure> LocalizeMeasures(const std::string& run, const std::vector<PanoramaResult>& panoramas,
                                          double confidence) {
  int answered = 0, without = 0;
  std::optional<double> largest;
  std::string of;
  for (const PanoramaResult& p : panoramas) {
    if (p.status != "localized") continue;
    ++answered;
    if (!p.sigma_m) {
      ++without;
    } else if (const double sigma = p.sigma_m->maxCoeff(); !largest || sigma > *largest) {
      largest = sigma;
      of = p.panorama;
    }
  }
  const int asked = static_cast<int>(panoramas.size());
  GateMeasure share{.gate = "localize.min_answered", .subject = run, .n = asked, .counted = "references"};
  if (asked > 0) {
    share.value = static_cast<double>(answered) / asked;
    share.interval = ShareInterval(*share.value, asked, confidence);
    share.confidence = confidence;
    share.design = GateDesign{asked, 1, asked, 1, 0, false, true};
  } else {
    share.reason = "no reference was asked for";
  }
  GateMeasure sigma =
      Complete("localize.max_sigma_m", run, largest, answered, "answers",
               answered == 0 ? "no answer" : "no answer has coordinates in the site's frame with a sigma");
  if (largest) sigma.note = "the largest is that of " + of;
  if (largest && without > 0) {
    sigma.complete = false;
    sigma.reason = fmt::format("{} of {} answers have no sigma in the site's frame", without, answered);
  }
  return {share, sigma};
}

std::vector<GateMeasure> EstimateMeasures(const json& estimates, const std::string& variant) {
  std::vector<GateMeasure> measures;
  for (const json& e : ListAt(estimates, "estimates")) {
    const std::string system = TextAt(e, "system"), subject = system + " on " + TextAt(e, "run");
    if (IsOwnSystem(system) && system != OwnSystem(variant)) continue;
    const int attempts = CountAt(e, {"attempts"}), answers = CountAt(e, {"answers"});
    GateMeasure ate{.gate = "estimates.max_ate_m", .subject = subject, .n = answers, .counted = "images"};
    ate.value = At(e, {"rmse_m"});
    ate.interval = OpenIntervalAt(e, "own_rmse_interval_m");
    ate.confidence = EstimateScoreOptions().confidence;
    if (!ate.value) ate.reason = "no image has both an estimate and a reference";
    if (ate.value && !ate.interval) ate.reason = "too short a time for an interval by blocks";
    measures.push_back(std::move(ate));
    const json& relative = e.contains("rpe") ? e["rpe"] : json();
    GateMeasure rpe{.gate = "estimates.max_rpe_m", .subject = subject, .value = At(relative, {"rmse_m"})};
    rpe.n = CountAt(relative, {"pieces"});
    rpe.counted = "pieces of path";
    rpe.interval = OpenIntervalAt(relative, "interval_m");
    rpe.confidence = EstimateScoreOptions().confidence;
    if (!rpe.value || !rpe.interval) rpe.reason = "too short a path: expected at least three pieces";
    measures.push_back(std::move(rpe));
    const std::optional<double> covered =
        attempts > 0 ? std::optional<double>(static_cast<double>(answers) / attempts) : std::nullopt;
    measures.push_back(
        Complete("estimates.min_coverage", subject, covered, attempts, "images", "no image has a reference"));
  }
  return measures;
}

std::vector<GateMeasure> StitchMeasures(const std::string& set, const json& metrics) {
  const int placed = CountAt(metrics, {"placed"});
  const auto full = metrics.is_object() && FlagAt(metrics, "full_turn");
  std::optional<double> closure = full ? At(metrics, {"closure_deg"}) : std::nullopt;
  if (closure) closure = std::abs(*closure);
  return {Complete("stitch.max_rms_px", set, At(metrics, {"rms_px"}), placed, "photos", "no residuals"),
          Complete("stitch.max_closure_deg", set, closure, placed, "photos", "the photos make no full turn"),
          Complete("stitch.min_coverage", set, At(metrics, {"covered_share"}), placed, "photos",
                   "no panorama was composed")};
}

std::vector<GateMeasure> CalibrationMeasures(const std::string& name, const json& metrics) {
  std::vector<GateMeasure> measures;
  for (const json& camera : ListAt(metrics, "cameras")) {
    const std::string its = TextAt(camera, "name"), subject = its.empty() ? name : name + " " + its;
    const int views = CountAt(camera, {"views_used"});
    measures.push_back(Complete("calibration.max_rms_px", subject, At(camera, {"rms_px"}), views, "views",
                                "no residuals: it was not calibrated from pictures"));
    std::optional<double> percent;
    const json& parameters = camera.is_object() && camera.contains("parameters") ? camera["parameters"] : json();
    for (const auto& [parameter, value] : parameters.items()) {
      const auto sigma = At(camera, {"sigma", parameter.c_str()});
      if (!parameter.starts_with("f") || !value.is_number() || value == 0 || !sigma) continue;
      percent = std::max(percent.value_or(0), 100 * *sigma / std::abs(value.get<double>()));
    }
    measures.push_back(Complete("calibration.max_focal_sigma_percent", subject, percent, views, "views",
                                "no sigma of a focal length"));
  }
  return measures;
}

}  // namespace trigpoint
