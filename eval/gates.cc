#include "eval/gates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "eval/distributions.h"

namespace trigpoint {
namespace {

// Variance of a mean over the group's design with further stations or runs, in units of one value's.
double MeanVariance(const GroupSummary& g, double stations, double runs) {
  const double rest = 1 - g.station_share - g.run_share;
  const double cells = g.answers * stations / g.stations * runs / std::max(1, g.runs);
  return g.station_share / stations + g.run_share / runs + rest / cells;
}

// How many stations (or runs) more would take the bound to the limit: the interval shrinks with the root of the mean's
// variance. `distance`: from the value, in the scale in which the interval is symmetrical.
void MoreData(const GroupSummary& g, double distance_to_bound, double distance_to_limit, GateResult* result) {
  if (!(distance_to_limit > 0) || g.stations < 1 || g.answers < 1) return;
  const double shrink = std::pow(distance_to_limit / distance_to_bound, 2);
  if (!(shrink > 1e-3)) return;
  const double now = MeanVariance(g, g.stations, std::max(1, g.runs));
  constexpr int kMost = 1000;
  const auto least = [&](bool stations) -> std::optional<int> {
    for (int more = 1; more <= kMost * (stations ? g.stations : std::max(1, g.runs)); ++more) {
      const double v = MeanVariance(g, g.stations + (stations ? more : 0), std::max(1, g.runs) + (stations ? 0 : more));
      if (v <= shrink * now * (1 + 1e-9)) return more;
    }
    return std::nullopt;
  };
  result->more_stations = least(true);
  // What runs add in common cannot be seen with a single one.
  if (g.runs > 1) result->more_runs = least(false);
}

void Finish(const Evaluation& evaluation, const char* unit, GateResult* result) {
  const std::string of =
      fmt::format("{} {} against {}{}", result->group.method, result->group.kind, result->group.reference,
                  result->group.shares_evidence ? ", which shares evidence with the runs" : "");
  if (!result->interval || !result->value) {
    result->message =
        fmt::format("{}: {} ({}): too few answers for an interval", ToString(result->verdict), result->gate, of);
    return;
  }
  result->message = fmt::format(
      "{}: {} ({}): {:.3g}{}, {:.0f} % interval {:.3g} to {:.3g}{}", ToString(result->verdict), result->gate, of,
      *result->value, unit, 100 * evaluation.options.confidence, result->interval->low, result->interval->high, unit);
  if (result->verdict != Verdict::kUndecided) return;
  const auto about = [](int n, const char* what) {
    return fmt::format("about {} more {}{}", n, what, n > 1 ? "s" : "");
  };
  if (result->more_stations && result->more_runs) {
    result->message += fmt::format("; {}, or {} past the same ones, would decide",
                                   about(*result->more_stations, "station"), about(*result->more_runs, "run"));
  } else if (result->more_stations) {
    result->message += "; " + about(*result->more_stations, "station") + " would decide";
  } else if (result->more_runs) {
    result->message += "; " + about(*result->more_runs, "run") + " would decide";
  } else {
    result->message += "; it lies too near the limit for more stations or runs to decide";
  }
}

GateResult CheckUpperLimit(const Evaluation& evaluation, const GroupSummary& group, const char* what, double limit,
                           const std::optional<double>& value, const std::optional<Interval>& interval) {
  GateResult r{
      .gate = fmt::format("{} <= {:g} m", what, limit), .group = group.group, .value = value, .interval = interval};
  if (value && interval) {
    r.verdict = interval->high <= limit ? Verdict::kPass : interval->low > limit ? Verdict::kFail : Verdict::kUndecided;
    if (r.verdict == Verdict::kUndecided && *value > 0) {
      const double to_bound = std::log((*value <= limit ? interval->high : interval->low) / *value);
      MoreData(group, std::abs(to_bound), std::abs(std::log(limit / *value)), &r);
    }
  }
  Finish(evaluation, " m", &r);
  return r;
}

GateResult CheckAnswered(const Evaluation& evaluation, const GroupSummary& group, double limit) {
  GateResult r{.gate = fmt::format("answered >= {:g}", limit), .group = group.group};
  if (group.attempts > 0) {
    r.value = static_cast<double>(group.answers) / group.attempts;
    // A station that cannot be answered is so in every run: no more independent trials than stations.
    r.interval = WilsonInterval(*r.value, std::min(group.attempts, group.stations), evaluation.options.confidence);
    r.verdict = r.interval->low >= limit   ? Verdict::kPass
                : r.interval->high < limit ? Verdict::kFail
                                           : Verdict::kUndecided;
    if (r.verdict == Verdict::kUndecided) {
      const double bound = *r.value >= limit ? r.interval->low : r.interval->high;
      // Only further stations are further trials.
      const double factor = std::pow((bound - *r.value) / (limit - *r.value), 2);
      if (factor < 1000) r.more_stations = std::max(1, static_cast<int>(std::ceil((factor - 1) * group.stations)));
    }
  }
  Finish(evaluation, "", &r);
  return r;
}

}  // namespace

std::string ToString(Verdict verdict) {
  return verdict == Verdict::kPass ? "PASS" : verdict == Verdict::kFail ? "FAIL" : "UNDECIDED";
}

Interval WilsonInterval(double share, double effective, double confidence) {
  const double z = NormalQuantile(0.5 * (1 + confidence)), z2 = z * z / effective;
  const double centre = (share + 0.5 * z2) / (1 + z2);
  const double half = z / (1 + z2) * std::sqrt(share * (1 - share) / effective + 0.25 * z2 / effective);
  return {std::max(0.0, centre - half), std::min(1.0, centre + half)};
}

std::vector<GateResult> CheckGates(const Evaluation& evaluation, const GateOptions& gates, const std::string& variant) {
  for (const std::string& problem : gates.Check()) throw OptionError(problem);
  std::vector<GateResult> results;
  if (!gates.Any()) return results;
  bool independent = false;
  const auto own = [&](const GroupSummary& g) { return g.group.variant == variant && g.group.method != "g1"; };
  for (const GroupSummary& g : evaluation.groups) {
    independent |= own(g) && !g.group.shares_evidence && g.attempts > 0;
  }
  for (const GroupSummary& group : evaluation.groups) {
    if (!own(group) || (independent && (group.group.shares_evidence || group.attempts == 0))) continue;
    if (gates.max_median_m > 0) {
      results.push_back(CheckUpperLimit(evaluation, group, "median", gates.max_median_m, group.error_3d.median,
                                        group.median_interval));
    }
    if (gates.max_p90_m > 0) {
      results.push_back(
          CheckUpperLimit(evaluation, group, "P90", gates.max_p90_m, group.error_3d.p90, group.p90_interval));
    }
    if (gates.min_answered > 0) results.push_back(CheckAnswered(evaluation, group, gates.min_answered));
  }
  if (results.empty()) {
    GateResult& nothing = results.emplace_back();
    nothing.gate = "any";
    nothing.message = "UNDECIDED: there is no answer with a reference to judge";
  }
  return results;
}

Verdict OverallVerdict(const std::vector<GateResult>& results) {
  Verdict overall = Verdict::kPass;
  for (const GateResult& r : results) {
    if (r.verdict == Verdict::kFail) return Verdict::kFail;
    if (r.verdict == Verdict::kUndecided) overall = Verdict::kUndecided;
  }
  return overall;
}

}  // namespace trigpoint
