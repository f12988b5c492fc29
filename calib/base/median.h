#pragma once

#include <algorithm>
#include <vector>

namespace trigpoint {

// The middle value (the upper one of two), 0 without values.
template <typename T = double>
T Median(std::vector<T> values) {
  if (values.empty()) return T{0};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace trigpoint
