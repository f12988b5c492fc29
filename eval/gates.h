// Quality gates: is the accuracy good enough to rely on? Decided by the confidence bound clustered by station and run,
// not by the point estimate: with nine stations most point estimates are coin tosses.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "eval/evaluate.h"

namespace trigpoint {

struct GateOptions {
  double max_median_m = 0;  // 0: no such gate
  double max_p90_m = 0;     // 0: no such gate
  double min_answered = 0;  // share of attempts; 0: no such gate
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_median_m, {"max_median_m", "m", 0.0, 1e6, "gate: median 3D error over answers; 0: none"});
    visit(self.max_p90_m, {"max_p90_m", "m", 0.0, 1e6, "gate: 90th percentile of the 3D error over answers; 0: none"});
    visit(self.min_answered, {"min_answered", "", 0.0, 1.0, "gate: share of attempts that are answered; 0: none"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
  bool Any() const { return max_median_m > 0 || max_p90_m > 0 || min_answered > 0; }
};

enum class Verdict { kPass, kFail, kUndecided };
std::string ToString(Verdict verdict);  // PASS, FAIL, UNDECIDED

struct GateResult {
  std::string gate;  // "median <= 0.2 m"
  ErrorGroup group;
  Verdict verdict = Verdict::kUndecided;
  std::optional<double> value;
  std::optional<Interval> interval;
  // About how many stations (each visited as often as those there) would decide it, if the value stays as it is; unset
  // unless undecided, or where no number of them would.
  std::optional<int> more_stations;
  std::optional<int> more_runs;  // the same for further runs past the same stations
  std::string message;           // one sentence
};

// PASS: the whole interval is within the limit; FAIL: the whole interval is beyond it; else UNDECIDED, also without
// answers. The interval's confidence is the evaluation's, two-sided.
// Judged are the answers of `variant` (not single views, G1): against the references the runs had no part in; only
// where there is none, against those that share evidence with them. One UNDECIDED result where there is nothing at all.
std::vector<GateResult> CheckGates(const Evaluation& evaluation, const GateOptions& gates,
                                   const std::string& variant = "");
// PASS if all pass, FAIL if any fails, else UNDECIDED. PASS for an empty list.
Verdict OverallVerdict(const std::vector<GateResult>& results);

// Wilson's score interval of a share, `effective` trials (Wilson 1927).
Interval WilsonInterval(double share, double effective, double confidence);

}  // namespace trigpoint
