// Confidence intervals of percentiles for errors that come in clusters: the same station in several runs, several
// stations in the same run. Taking them as independent makes intervals too narrow; resampling whole stations or runs
// fails with the handful there is (the P90 of nine stations lies beyond what was seen in 40 % of campaigns).
//
// So this is a parametric bootstrap of a crossed random-effects model on the logarithm of the error,
//   y_rsk = mean + station_s + run_r + cell_rs + rest_rsk,
// where a cell has the answers of one run at one station (several photos, several cameras). Variance components come
// from the squared differences of pairs (same station, same run, both, neither); campaigns are redrawn on the design as
// it was (blanks stay blank). The spread is redrawn with the degrees of freedom that stations and runs leave
// (Satterthwaite 1946); above the median it is that of the upper half, so that a tail other than log-normal counts.
// With one run (or one station) its common effect cannot be seen: the interval is then about that run (station).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace trigpoint {

struct Interval {
  double low = 0, high = 0;
};

struct ClusteredValue {
  double value = 0;
  int station = 0;  // cluster indices, any integers
  int run = 0;
};

struct BootstrapOptions {
  int samples = 2000;
  double confidence = 0.95;
  uint64_t seed = 1;
};

enum class BootstrapScale {
  kLog,     // errors: positive, long upper tail
  kLinear,  // differences: any sign
};

// Interval of quantile q, 0 < q < 1. Unset with fewer than three values or no spread. O(n^2 + samples n log n).
std::optional<Interval> ClusteredQuantileInterval(const std::vector<ClusteredValue>& values, double q,
                                                  const BootstrapOptions& options = {},
                                                  BootstrapScale scale = BootstrapScale::kLog);

// Shares of the errors' variance (of their logarithms) that stations and runs have in common; 0 with one run or
// station.
struct VarianceShares {
  double station = 0, run = 0;
};
VarianceShares ClusterShares(const std::vector<ClusteredValue>& values);

// Cumulative histogram of errors with a pointwise confidence band. Abstentions count as worse than any number, so that
// the curve ends at answers / attempts.
struct CumulativePoint {
  double error = 0;
  double share = 0;  // of attempts with at most this error
  double low = 0, high = 0;
};
std::vector<CumulativePoint> CumulativeHistogram(const std::vector<ClusteredValue>& errors, int abstentions,
                                                 const BootstrapOptions& options = {});

}  // namespace trigpoint
