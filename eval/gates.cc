#include "eval/gates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "eval/distributions.h"

namespace trigpoint {
namespace {

// How many stations more would take the bound from `bound` to `limit`, widths shrinking with the root of their number
// (`distance`: from the value, in the scale in which the interval is symmetrical).
std::optional<int> MoreStations(double distance_to_bound, double distance_to_limit, int stations) {
  if (!(distance_to_limit > 0)) return std::nullopt;
  const double factor = std::pow(distance_to_bound / distance_to_limit, 2);
  if (!(factor < 1000)) return std::nullopt;
  return std::max(1, static_cast<int>(std::ceil((factor - 1) * stations)));
}

void Finish(const Evaluation& evaluation, const char* unit, GateResult* result) {
  const std::string of =
      fmt::format("{} {} against {}", result->group.method, result->group.kind, result->group.reference);
  if (!result->interval || !result->value) {
    result->message =
        fmt::format("{}: {} ({}): too few answers for an interval", ToString(result->verdict), result->gate, of);
    return;
  }
  result->message = fmt::format(
      "{}: {} ({}): {:.3g}{}, {:.0f} % interval {:.3g} to {:.3g}{}", ToString(result->verdict), result->gate, of,
      *result->value, unit, 100 * evaluation.options.confidence, result->interval->low, result->interval->high, unit);
  if (result->verdict != Verdict::kUndecided) return;
  result->message += result->more_stations
                         ? fmt::format("; about {} more stations would decide", *result->more_stations)
                         : "; it lies too near the limit for more stations to decide";
}

GateResult CheckUpperLimit(const Evaluation& evaluation, const GroupSummary& group, const char* what, double limit,
                           const std::optional<double>& value, const std::optional<Interval>& interval) {
  GateResult r{
      .gate = fmt::format("{} <= {:g} m", what, limit), .group = group.group, .value = value, .interval = interval};
  if (value && interval) {
    r.verdict = interval->high <= limit ? Verdict::kPass : interval->low > limit ? Verdict::kFail : Verdict::kUndecided;
    if (r.verdict == Verdict::kUndecided && *value > 0) {
      const double to_bound = std::log((*value <= limit ? interval->high : interval->low) / *value);
      r.more_stations = MoreStations(std::abs(to_bound), std::abs(std::log(limit / *value)), group.stations);
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
      r.more_stations = MoreStations(std::abs(bound - *r.value), std::abs(limit - *r.value), group.stations);
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

std::vector<GateResult> CheckGates(const Evaluation& evaluation, const GateOptions& gates) {
  for (const std::string& problem : gates.Check()) throw OptionError(problem);
  std::vector<GateResult> results;
  for (const GroupSummary& group : evaluation.groups) {
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
