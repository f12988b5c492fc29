#include "eval/gates/intervals.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "eval/statistics/distributions.h"

namespace trigpoint {

Interval ShareInterval(double share, double trials, double confidence) {
  if (!(trials > 0) || !(share >= 0 && share <= 1)) throw NumericError("interval of a share: no trials, or no share");
  const double tail = 0.5 * (1 - confidence), hits = share * trials, misses = trials - hits;
  constexpr double kNone = 1e-9;
  return {hits > kNone ? BetaQuantile(tail, hits, misses + 1) : 0,
          misses > kNone ? BetaQuantile(1 - tail, hits + 1, misses) : 1};
}

Interval RmsInterval(double rms, double dof, double confidence) {
  const double tail = 0.5 * (1 - confidence);
  return {rms * std::sqrt(dof / ChiSquareQuantile(1 - tail, dof)), rms * std::sqrt(dof / ChiSquareQuantile(tail, dof))};
}

std::optional<RmseInterval> RmseWithInterval(const std::vector<std::vector<double>>& components, double confidence) {
  const size_t n = components.empty() ? 0 : components.front().size();
  if (n < kLeastForRmse) return std::nullopt;
  double sum = 0, largest = 0;
  for (const std::vector<double>& component : components) {
    double mean_square = 0;
    for (const double e : component) mean_square += e * e / static_cast<double>(n);
    sum += mean_square;
    largest = std::max(largest, mean_square);
  }
  if (!(largest > 0)) return std::nullopt;
  RmseInterval result;
  result.rmse = std::sqrt(sum);
  result.dof = static_cast<double>(n) * sum / largest;
  result.interval = RmsInterval(result.rmse, result.dof, confidence);
  return result;
}

}  // namespace trigpoint
