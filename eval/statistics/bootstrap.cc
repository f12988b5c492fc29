#include "eval/statistics/bootstrap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "calib/estimation/random.h"
#include "eval/statistics/distributions.h"
#include "eval/statistics/statistics.h"

namespace trigpoint {
namespace {

// The crossed random-effects model of a sample; shares of the variance that stations, runs and the answers of one run
// at one station (a cell) have.
struct CrossedModel {
  std::vector<double> y;
  std::vector<size_t> station, run, cell;  // dense cluster indices
  size_t stations = 0, runs = 0, cells = 0;
  double variance = 0;
  double station_share = 0, run_share = 0, cell_share = 0;
  double dof = 1;
};

// Half the mean squared difference of pairs of values, by what the two share.
struct PairVariances {
  enum Kind { kNothing, kStation, kRun, kCell };
  std::array<double, 4> sum{}, count{};
  bool Any(Kind kind) const { return count[kind] > 0 && sum[kind] > 0; }
  double Of(Kind kind) const { return sum[kind] / count[kind]; }
};

std::vector<size_t> Dense(const std::vector<ClusteredValue>& values, int ClusteredValue::*member, size_t* count) {
  std::map<int, size_t> index;
  std::vector<size_t> dense;
  dense.reserve(values.size());
  for (const ClusteredValue& v : values) dense.push_back(index.emplace(v.*member, index.size()).first->second);
  *count = index.size();
  return dense;
}

// Where values are nearly normal, and back. Both are monotone: a quantile's interval may be taken there.
class Transform {
 public:
  Transform(const std::vector<ClusteredValue>& values, BootstrapScale scale) : scale_(scale) {
    if (scale == BootstrapScale::kLog) return;
    std::vector<double> sizes;
    for (const ClusteredValue& v : values) sizes.push_back(std::abs(v.value));
    for (const double q : {0.5, 0.9, 1.0}) {
      if (unit_ = Quantile(sizes, q); unit_ > 0) return;
    }
    unit_ = 1;
  }
  double operator()(double v) const {
    constexpr double kLeastError = 1e-9;  // an error of zero has no logarithm
    return scale_ == BootstrapScale::kLog ? std::log(std::max(v, kLeastError)) : std::asinh(v / unit_);
  }
  double Back(double y) const { return scale_ == BootstrapScale::kLog ? std::exp(y) : unit_ * std::sinh(y); }

 private:
  BootstrapScale scale_;
  double unit_ = 1;  // the typical size of a difference: linear below it, logarithmic beyond
};

PairVariances VariancesOfPairs(const CrossedModel& m) {
  PairVariances pairs;
  for (size_t i = 0; i < m.y.size(); ++i) {
    for (size_t j = i + 1; j < m.y.size(); ++j) {
      const size_t kind = (m.station[i] == m.station[j] ? PairVariances::kStation : 0) +
                          (m.run[i] == m.run[j] ? PairVariances::kRun : 0);
      pairs.sum[kind] += 0.5 * (m.y[i] - m.y[j]) * (m.y[i] - m.y[j]);
      pairs.count[kind] += 1;
    }
  }
  return pairs;
}

void SetShares(const PairVariances& pairs, PairVariances::Kind base, CrossedModel* m) {
  constexpr double kMost = 0.99;  // something is left to each answer
  const auto share = [&](PairVariances::Kind kind) {
    return kind != base && pairs.count[kind] > 0 ? std::clamp(1 - pairs.Of(kind) / m->variance, 0.0, kMost) : 0.0;
  };
  if (base == PairVariances::kNothing) {
    m->station_share = share(PairVariances::kStation);
    m->run_share = share(PairVariances::kRun);
  }
  if (const double both = m->station_share + m->run_share; both > kMost) {
    m->station_share *= kMost / both;
    m->run_share *= kMost / both;
  }
  m->cell_share = std::max(0.0, share(PairVariances::kCell) - m->station_share - m->run_share);
}

// The mean's variance in units of one value's: what stations add rests on their number, what runs and cells add on
// theirs (Satterthwaite).
double DegreesOfFreedom(const CrossedModel& m, const PairVariances& pairs) {
  const double n = static_cast<double>(m.y.size());
  const auto& count = pairs.count;
  const double by_station = 2 * (count[PairVariances::kStation] + count[PairVariances::kCell]) / n * m.station_share;
  const double by_run = 2 * (count[PairVariances::kRun] + count[PairVariances::kCell]) / n * m.run_share;
  const double by_cell = 2 * count[PairVariances::kCell] / n * m.cell_share;
  const double total = 1 + by_station + by_run + by_cell;
  const auto term = [](double part, size_t clusters) {
    return part * part / std::max(1.0, static_cast<double>(clusters) - 1);
  };
  return std::max(
      1.0,
      total * total / (1 / (n - 1) + term(by_station, m.stations) + term(by_run, m.runs) + term(by_cell, m.cells)));
}

CrossedModel FitModel(const std::vector<ClusteredValue>& values, const Transform& transform) {
  CrossedModel m;
  for (const ClusteredValue& v : values) m.y.push_back(transform(v.value));
  m.station = Dense(values, &ClusteredValue::station, &m.stations);
  m.run = Dense(values, &ClusteredValue::run, &m.runs);

  std::map<std::pair<size_t, size_t>, size_t> cells;
  for (size_t i = 0; i < m.y.size(); ++i) {
    m.cell.push_back(cells.emplace(std::pair(m.station[i], m.run[i]), cells.size()).first->second);
  }
  m.cells = cells.size();
  const PairVariances pairs = VariancesOfPairs(m);
  const double n = static_cast<double>(m.y.size());
  m.dof = n - 1;
  // One run (station) alone: its common effect cannot be seen, the variance is that about it.
  const auto base = m.runs < 2       ? PairVariances::kRun
                    : m.stations < 2 ? PairVariances::kStation
                                     : PairVariances::kNothing;
  if (!pairs.Any(base)) {
    const auto total = [](const std::array<double, 4>& a) { return std::accumulate(a.begin(), a.end(), 0.0); };
    m.variance = total(pairs.sum) / total(pairs.count);
    return m;
  }
  m.variance = pairs.Of(base);
  SetShares(pairs, base, &m);
  m.dof = DegreesOfFreedom(m, pairs);
  return m;
}

// A campaign of the model with unit variance and mean zero.
std::vector<double> Draw(const CrossedModel& m, Random* random) {
  std::vector<double> station(m.stations), run(m.runs), cell(m.cells), y(m.y.size());
  for (double& v : station) v = std::sqrt(m.station_share) * random->Normal();
  for (double& v : run) v = std::sqrt(m.run_share) * random->Normal();
  if (m.cell_share > 0) {
    for (double& v : cell) v = std::sqrt(m.cell_share) * random->Normal();
  }
  const double rest = std::sqrt(1 - m.station_share - m.run_share - m.cell_share);
  for (size_t i = 0; i < y.size(); ++i) {
    y[i] = station[m.station[i]] + run[m.run[i]] + cell[m.cell[i]] + rest * random->Normal();
  }
  return y;
}

// Standard deviation beyond the median on the side of the quantile, against that of both sides.
double SideRatio(const std::vector<double>& y, bool upper) {
  const double median = Quantile(y, 0.5);
  double side = 0, all = 0;
  size_t n = 0;
  for (const double v : y) {
    all += (v - median) * (v - median);
    if (v == median || (v > median) != upper) continue;
    side += (v - median) * (v - median);
    ++n;
  }
  if (n == 0 || !(all > 0)) return 1;
  return std::sqrt(side / static_cast<double>(n) / (all / static_cast<double>(y.size())));
}

}  // namespace

std::optional<Interval> ClusteredQuantileInterval(const std::vector<ClusteredValue>& values, double q,
                                                  const BootstrapOptions& options, BootstrapScale scale) {
  if (values.size() < 3 || options.samples < 1) return std::nullopt;
  const Transform transform(values, scale);
  const CrossedModel model = FitModel(values, transform);
  if (!(model.variance > 0)) return std::nullopt;

  // Beyond the median only half of the values determine the spread.
  const bool at_median = std::abs(q - 0.5) < 0.05;
  const double spread = std::sqrt(model.variance) * (at_median ? 1 : SideRatio(model.y, q > 0.5));
  const double dof = at_median ? model.dof : std::max(1.0, 0.5 * model.dof);

  Random random(options.seed);
  const double truth = NormalQuantile(q);
  std::vector<double> deviation;
  deviation.reserve(static_cast<size_t>(options.samples));
  for (int i = 0; i < options.samples; ++i) deviation.push_back(Quantile(Draw(model, &random), q) - truth);
  const double bias = Quantile(deviation, 0.5);
  std::vector<double> width;
  for (const double d : deviation) {
    const double chi2 = ChiSquareQuantile(std::clamp(random.Uniform(), 1e-12, 1 - 1e-12), dof);
    width.push_back(std::abs(d - bias) * std::sqrt(dof / chi2));
  }
  const double centre = Quantile(model.y, q) - bias * spread;
  const double half = spread * Quantile(width, options.confidence);
  return Interval{transform.Back(centre - half), transform.Back(centre + half)};
}

VarianceShares ClusterShares(const std::vector<ClusteredValue>& values) {
  if (values.size() < 3) return {};
  const CrossedModel model = FitModel(values, Transform(values, BootstrapScale::kLog));
  return {model.station_share, model.run_share};
}

std::vector<CumulativePoint> CumulativeHistogram(const std::vector<ClusteredValue>& errors, int abstentions,
                                                 const BootstrapOptions& options) {
  std::vector<CumulativePoint> points;
  if (errors.empty()) return points;
  std::vector<double> sorted;
  sorted.reserve(errors.size());
  for (const ClusteredValue& e : errors) sorted.push_back(e.value);
  std::sort(sorted.begin(), sorted.end());
  const CrossedModel model = FitModel(errors, Transform(errors, BootstrapScale::kLog));
  Random random(options.seed);
  std::vector<std::vector<double>> campaigns;
  for (int i = 0; i < options.samples; ++i) {
    campaigns.push_back(Draw(model, &random));
    std::sort(campaigns.back().begin(), campaigns.back().end());
  }
  const double n = static_cast<double>(sorted.size());
  const double answered = n / (n + std::max(abstentions, 0));
  for (size_t k = 0; k < sorted.size(); ++k) {
    if (k + 1 < sorted.size() && sorted[k + 1] == sorted[k]) continue;
    CumulativePoint point{.error = sorted[k], .share = answered * static_cast<double>(k + 1) / n};
    const double threshold = NormalQuantile((static_cast<double>(k) + 0.5) / n);
    std::vector<double> shares;
    shares.reserve(campaigns.size());
    for (const std::vector<double>& c : campaigns) {
      shares.push_back(static_cast<double>(std::upper_bound(c.begin(), c.end(), threshold) - c.begin()) / n);
    }
    point.low = point.high = point.share;
    if (!shares.empty()) {
      point.low = answered * Quantile(shares, 0.5 * (1 - options.confidence));
      point.high = answered * Quantile(shares, 0.5 * (1 + options.confidence));
    }
    points.push_back(point);
  }
  return points;
}

}  // namespace trigpoint
