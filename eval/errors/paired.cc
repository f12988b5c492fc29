#include "eval/errors/paired.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

std::vector<double> WithoutZeros(std::vector<double> values) {
  values.erase(std::remove(values.begin(), values.end(), 0.0), values.end());
  return values;
}

using CellKey = std::tuple<std::string, std::string, std::string>;

std::map<CellKey, std::optional<double>> ByCell(const std::vector<ErrorRow>& rows) {
  std::map<CellKey, std::optional<double>> cells;
  for (const ErrorRow& row : rows) cells.emplace(CellKey(row.run, row.station, row.panorama), row.error_3d_m);
  return cells;
}

}  // namespace

double SignTest(const std::vector<double>& differences) {
  const std::vector<double> d = WithoutZeros(differences);
  const auto n = static_cast<int>(d.size());
  if (n == 0) return 1;
  const auto positive = static_cast<int>(std::count_if(d.begin(), d.end(), [](double v) { return v > 0; }));
  return std::min(1.0, 2 * BinomialCdf(std::min(positive, n - positive), n, 0.5));
}

double WilcoxonSignedRankTest(const std::vector<double>& differences) {
  std::vector<double> d = WithoutZeros(differences);
  const size_t n = d.size();
  if (n == 0) return 1;
  std::sort(d.begin(), d.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  double positive = 0, ties = 0;
  for (size_t i = 0, j = 0; i < n; i = j) {
    while (j < n && std::abs(d[j]) == std::abs(d[i])) ++j;
    const double count = static_cast<double>(j - i), rank = 0.5 * static_cast<double>(i + j + 1);
    for (size_t k = i; k < j; ++k) positive += d[k] > 0 ? rank : 0;
    ties += count * count * count - count;
  }
  const double size = static_cast<double>(n), total = 0.5 * size * (size + 1);
  const double smaller = std::min(positive, total - positive);
  if (ties == 0 && n <= 25) {
    // Number of sign patterns with each rank sum.
    std::vector<double> patterns(static_cast<size_t>(total) + 1, 0.0);
    patterns[0] = 1;
    for (size_t rank = 1; rank <= n; ++rank) {
      for (size_t sum = patterns.size() - 1; sum >= rank; --sum) patterns[sum] += patterns[sum - rank];
    }
    double below = 0;
    for (size_t sum = 0; sum <= static_cast<size_t>(smaller); ++sum) below += patterns[sum];
    return std::min(1.0, 2 * below / std::pow(2.0, size));
  }
  const double variance = size * (size + 1) * (2 * size + 1) / 24 - ties / 48;
  const double z = (smaller - 0.5 * total + 0.5) / std::sqrt(variance);
  return std::min(1.0, 2 * NormalCdf(z));
}

PairedComparison ComparePaired(const std::vector<ErrorRow>& a, const std::vector<ErrorRow>& b,
                               const BootstrapOptions& options) {
  PairedComparison c;
  c.confidence = options.confidence;
  const auto cells_a = ByCell(a), cells_b = ByCell(b);
  std::map<std::string, int> runs, stations;
  std::vector<ClusteredValue> clustered;
  std::vector<double> differences;
  std::map<std::string, std::vector<double>> by_station;
  for (const auto& [key, error_a] : cells_a) {
    const auto it = cells_b.find(key);
    const std::optional<double> error_b = it == cells_b.end() ? std::nullopt : it->second;
    c.only_a += error_a && !error_b;
    c.only_b += error_b && !error_a;
    if (!error_a || !error_b) continue;
    const double d = *error_a - *error_b;
    const auto& [run, station, panorama] = key;
    clustered.push_back({d, stations.emplace(station, static_cast<int>(stations.size())).first->second,
                         runs.emplace(run, static_cast<int>(runs.size())).first->second});
    differences.push_back(d);
    by_station[station].push_back(d);
    c.a_better += d < 0;
    c.b_better += d > 0;
  }
  for (const auto& [key, error_b] : cells_b) c.only_b += error_b && cells_a.count(key) == 0;
  c.pairs = static_cast<int>(differences.size());
  c.stations = static_cast<int>(by_station.size());
  if (differences.empty()) return c;
  c.median_difference_m = Quantile(differences, 0.5);
  c.difference_interval_m = ClusteredQuantileInterval(clustered, 0.5, options, BootstrapScale::kLinear);
  std::vector<double> means;
  for (const auto& [station, values] : by_station) {
    double sum = 0;
    for (const double v : values) sum += v;
    means.push_back(sum / static_cast<double>(values.size()));
  }
  c.sign_p = SignTest(means);
  c.wilcoxon_p = WilcoxonSignedRankTest(means);
  return c;
}

std::string Describe(const PairedComparison& c, const std::string& a, const std::string& b, const std::string& unit,
                     double metres_per_unit) {
  std::string text;
  if (c.pairs == 0) {
    text = fmt::format("{} and {} have no answer in common", a, b);
  } else {
    // The sign of tables that state B - A.
    text = fmt::format("{} is better than {} in {} of {} pairs; median of {} - {}: {:.3f} {}", b, a, c.b_better,
                       c.pairs, b, a, -*c.median_difference_m / metres_per_unit, unit);
    if (c.difference_interval_m) {
      text += fmt::format(" ({:.4g} % interval {:.3f} to {:.3f})", 100 * c.confidence,
                          -c.difference_interval_m->high / metres_per_unit,
                          -c.difference_interval_m->low / metres_per_unit);
    }
    text +=
        fmt::format(", p = {:.3g} (Wilcoxon) and {:.3g} (sign) over {} stations", c.wilcoxon_p, c.sign_p, c.stations);
  }
  return text + fmt::format("; answered by {} alone: {}, by {} alone: {}", a, c.only_a, b, c.only_b);
}

}  // namespace trigpoint
