// Confidence intervals of what gates compare with a limit.
#pragma once

#include <optional>
#include <vector>

#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// Clopper and Pearson's (1934) interval of a share: it covers with at least `confidence`. `trials`: as many as are
// independent, which need not be a whole number.
Interval ShareInterval(double share, double trials, double confidence);

// Fewer have no interval: a chi-square interval of two is eight times as wide as its value.
constexpr int kLeastForRmse = 3;

// Root of the mean sum of squares of errors with several components: `components[k]` holds component k of every item,
// zero-mean and independent between items. The sum follows nearly a chi-square with Satterthwaite's (1946) degrees of
// freedom n (sum m_k)^2 / sum m_k^2, m_k the mean square of component k; put in as estimates these are too many where
// one component dominates (an upper bound at 95 % was passed by 4.8 % instead of 2.5). n sum m_k / max m_k are never
// more and keep the bound within 3 % from six items on. Unset with fewer than kLeastForRmse items.
struct RmseInterval {
  double rmse = 0;
  double dof = 0;
  Interval interval;
};
std::optional<RmseInterval> RmseWithInterval(const std::vector<std::vector<double>>& components, double confidence);

// The chi-square interval of a root mean square that `dof` independent components gave.
Interval RmsInterval(double rms, double dof, double confidence);

}  // namespace trigpoint
