// Statistics of error samples. An abstention is not an error of some size: it counts as "worse than any number".
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

// Quantile q in [0, 1] of a sample with linear interpolation between order statistics (type 7 of Hyndman and Fan
// 1996, numpy's default): h = (n - 1) q. Throws InputError for an empty sample. O(n log n).
double Quantile(std::vector<double> sample, double q);

// The same with `abstentions` further values that are larger than any number. Unset when the quantile falls among them
// (or there is nothing at all).
std::optional<double> QuantileOverAttempts(std::vector<double> sample, int abstentions, double q);

// The usual numbers of a sample of errors, over answers and over attempts.
struct ErrorStatistics {
  int answers = 0;
  int attempts = 0;  // answers and abstentions
  // Over answers; unset without any.
  std::optional<double> median, p90, mean, rmse, max;
  // Over attempts; unset where the percentile falls among the abstentions.
  std::optional<double> median_attempts, p90_attempts;
  // Share of the answers and of the attempts with an error of at most 1.0 and 1.5 (metres); 0 without any.
  double within_1m = 0, within_1m5 = 0;
  double within_1m_attempts = 0, within_1m5_attempts = 0;
};
ErrorStatistics Summarize(const std::vector<double>& errors, int abstentions);

}  // namespace trigpoint
