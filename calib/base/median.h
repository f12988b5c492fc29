#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace trigpoint {

// The middle value (the upper one of two), 0 without values.
template <typename Number = double>
Number Median(std::vector<Number> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Medians of chi-square by its degrees of freedom.
inline constexpr double kMediansOfChi2[] = {0, 0.455, 1.386, 2.366, 3.357, 4.35};

// How large errors of so many components are against their stated sigmas, by the median of their chi-squares.
inline double SigmaRatio(std::vector<double> chi2, size_t components) {
  return std::sqrt(Median(std::move(chi2)) / kMediansOfChi2[components]);
}

}  // namespace trigpoint
