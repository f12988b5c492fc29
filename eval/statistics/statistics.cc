#include "eval/statistics/statistics.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

// The two order statistics around position (n - 1) q and the weight of the upper one.
struct QuantilePosition {
  size_t lower;
  double weight;
};

QuantilePosition PositionOf(size_t n, double q) {
  const double h = static_cast<double>(n - 1) * std::clamp(q, 0.0, 1.0);
  const double lower = std::floor(h);
  return {static_cast<size_t>(lower), h - lower};
}

}  // namespace

double Quantile(std::vector<double> sample, double q) {
  if (sample.empty()) throw InputError("quantile of an empty sample: there are no answers");
  std::sort(sample.begin(), sample.end());
  const auto [lower, weight] = PositionOf(sample.size(), q);
  if (weight == 0) return sample[lower];
  return sample[lower] + weight * (sample[lower + 1] - sample[lower]);
}

std::optional<double> QuantileOverAttempts(std::vector<double> sample, int abstentions, double q) {
  const size_t n = sample.size() + static_cast<size_t>(std::max(abstentions, 0));
  if (n == 0) return std::nullopt;
  std::sort(sample.begin(), sample.end());
  const auto [lower, weight] = PositionOf(n, q);
  if (lower >= sample.size()) return std::nullopt;
  if (weight == 0) return sample[lower];
  if (lower + 1 >= sample.size()) return std::nullopt;
  return sample[lower] + weight * (sample[lower + 1] - sample[lower]);
}

ErrorStatistics Summarize(const std::vector<double>& errors, int abstentions) {
  ErrorStatistics s;
  s.answers = static_cast<int>(errors.size());
  s.attempts = s.answers + abstentions;
  s.median_attempts = QuantileOverAttempts(errors, abstentions, 0.5);
  s.p90_attempts = QuantileOverAttempts(errors, abstentions, 0.9);
  if (errors.empty()) return s;
  const double n = static_cast<double>(errors.size());
  double sum = 0, squares = 0;
  int within_1m = 0, within_1m5 = 0;
  for (const double e : errors) {
    sum += e;
    squares += e * e;
    within_1m += e <= 1.0;
    within_1m5 += e <= 1.5;
  }
  s.median = Quantile(errors, 0.5);
  s.p90 = Quantile(errors, 0.9);
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  s.max = *std::max_element(errors.begin(), errors.end());
  s.within_1m = within_1m / n;
  s.within_1m5 = within_1m5 / n;
  s.within_1m_attempts = within_1m / static_cast<double>(s.attempts);
  s.within_1m5_attempts = within_1m5 / static_cast<double>(s.attempts);
  return s;
}

}  // namespace trigpoint
