// Paired comparison of two sets of errors: the same station in the same run, twice. Looking at two curves side by side
// throws the pairing away.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/errors/evaluate.h"
#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// Two-sided p values for "differences are as often negative as positive" (sign test, exact) and "differences are
// symmetrical about zero" (Wilcoxon's signed ranks; exact up to 25 differences without ties, else normal with
// corrections for ties and continuity). Zeros are left out. 1 without any difference.
double SignTest(const std::vector<double>& differences);
double WilcoxonSignedRankTest(const std::vector<double>& differences);

struct PairedComparison {
  int pairs = 0;               // answered in both
  int only_a = 0, only_b = 0;  // answered in one alone
  int a_better = 0, b_better = 0;
  std::optional<double> median_difference_m;      // of a - b: positive where b is better
  std::optional<Interval> difference_interval_m;  // clustered by station and run
  double confidence = 0;                          // of the interval
  // Of the differences' means by station: cells of one station are no independent evidence.
  int stations = 0;
  double sign_p = 1, wilcoxon_p = 1;
};

// Pairs rows by run, station and panorama; rows of other kinds than each other's are the caller's fault. Doubled keys:
// the first counts.
PairedComparison ComparePaired(const std::vector<ErrorRow>& a, const std::vector<ErrorRow>& b,
                               const BootstrapOptions& options = {});
// One sentence: "b is better than a in 7 of 9 pairs; median of b - a: -0.120 m (95 % interval -0.250 to -0.030), p =
// 0.04 (Wilcoxon) and 0.18 (sign) over 9 stations".
std::string Describe(const PairedComparison& comparison, const std::string& a, const std::string& b,
                     const std::string& unit = "m", double metres_per_unit = 1);

}  // namespace trigpoint
