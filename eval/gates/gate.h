// Quality gates: is a result good enough to rely on? Decided by the confidence bound, not by the point estimate: with
// nine stations most point estimates are coin tosses. What was not evaluated is undecided, never passed.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "eval/gates/limits.h"
#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// How often stations were visited by runs, and what share of the errors' variance each has in common: with it an
// undecided gate can state how many more would about decide it.
struct GateDesign {
  int stations = 0, runs = 0, answers = 0;
  double station_share = 0, run_share = 0;
  bool logarithmic = true;     // the interval is symmetrical in the logarithm; else in the value
  bool stations_only = false;  // further runs are no further trials
};

// What a gate compares with its limit.
struct GateMeasure {
  std::string gate;     // GateLimit::Gate()
  std::string subject;  // a run, a photo set, a comparison; empty: the project
  std::optional<double> value;
  // Every item was looked at and nothing is inferred from a sample: the value decides by itself.
  bool complete = false;
  std::optional<Interval> interval;
  double confidence = 0;  // of the interval
  int n = 0;
  std::string counted;  // what n counts: "check points"
  std::string reason;   // why there is no value or no interval
  std::string note;     // what else must be known of it: "agreement: the reference shares data with the runs"
  std::optional<GateDesign> design;
};

enum class Verdict { kPassed, kFailed, kUndecided };
std::string ToString(Verdict verdict);  // passed, failed, undecided

struct GateResult {
  GateLimit limit;
  GateMeasure measure;
  Verdict verdict = Verdict::kUndecided;
  std::optional<int> more_stations, more_runs;  // would about decide, if the value stays as it is
  std::string Text() const;                     // "evaluate.max_median_m <= 0.2 m"
  std::string message;                          // one sentence
};

// Passed: the whole interval is within the limit; failed: the whole interval is beyond it; else undecided, also
// without a value, or without an interval unless `complete`.
GateResult Judge(const GateLimit& limit, const GateMeasure& measure);

// A result for every limit that is set and every measure of it; one that nothing measures is undecided.
std::vector<GateResult> JudgeAll(const std::vector<GateLimit>& limits, const std::vector<GateMeasure>& measures);

// Passed if all passed, failed if any failed, else undecided. Undecided for an empty list.
Verdict OverallVerdict(const std::vector<GateResult>& results);

// The table of verdicts, Markdown. Lengths in units of `metres_per_unit`.
std::string FormatGates(const std::vector<GateResult>& results, const std::string& unit = "m",
                        double metres_per_unit = 1);

// gates.json, and one of its rows.
nlohmann::json GateJson(const GateResult& result);
nlohmann::json GatesJson(const std::vector<GateResult>& results);

}  // namespace trigpoint
