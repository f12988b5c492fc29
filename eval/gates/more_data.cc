#include "eval/gates/more_data.h"

#include <algorithm>
#include <cmath>

namespace trigpoint {
namespace {

// Variance of a mean over the design with further stations or runs, in units of one value's.
double MeanVariance(const GateDesign& d, double stations, double runs) {
  const double rest = 1 - d.station_share - d.run_share;
  const double cells = d.answers * stations / d.stations * runs / std::max(1, d.runs);
  return d.station_share / stations + d.run_share / runs + rest / cells;
}

}  // namespace

void MoreData(GateResult* result) {
  const GateMeasure& m = result->measure;
  const GateDesign& d = *m.design;
  const double value = *m.value, limit = result->limit.limit;
  if (d.stations < 1 || d.answers < 1) return;
  if (d.logarithmic && !(value > 0 && m.interval->low > 0)) return;
  const auto scale = [&](double x) { return d.logarithmic ? std::log(x) : x; };
  const bool bound_is_high = limit >= value;
  const double to_bound = std::abs(scale(bound_is_high ? m.interval->high : m.interval->low) - scale(value));
  const double to_limit = std::abs(scale(limit) - scale(value));
  if (!(to_limit > 0) || !(to_bound > 0)) return;
  // The interval shrinks with the root of the mean's variance.
  const double shrink = std::pow(to_limit / to_bound, 2);
  if (!(shrink > 1e-3)) return;
  const int runs = std::max(1, d.runs);
  const double now = MeanVariance(d, d.stations, runs);
  constexpr int kMost = 1000;
  const auto least = [&](bool stations) -> std::optional<int> {
    for (int more = 1; more <= kMost * (stations ? d.stations : runs); ++more) {
      const double v = MeanVariance(d, d.stations + (stations ? more : 0), runs + (stations ? 0 : more));
      if (v <= shrink * now * (1 + 1e-9)) return more;
    }
    return std::nullopt;
  };
  result->more_stations = least(true);
  // What runs add in common cannot be seen with a single one.
  if (d.runs > 1 && !d.stations_only) result->more_runs = least(false);
}

}  // namespace trigpoint
