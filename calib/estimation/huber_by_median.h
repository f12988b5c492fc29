#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "calib/base/median.h"

namespace trigpoint {

// Huber's weights where the noise is not known: each round takes it from the median of the last round's residuals, and
// never as smaller than stated.
class HuberByMedian {
 public:
  // Of a residual of one to three components, by its norm (in stated sigmas of a component), which counts for the next
  // round.
  double Weight(double norm, size_t components = 1) {
    sizes_.push_back(norm / kMedians[components - 1]);
    const double scaled = sizes_.back() / noise_;
    return scaled > kKnee ? kKnee / scaled : 1;
  }
  void EndRound() { noise_ = std::max(1.0, Median(std::exchange(sizes_, {}))); }
  double noise() const { return noise_; }  // of a component, in stated sigmas, >= 1

 private:
  // Of the norm of that many normal components of sigma 1: roots of the medians of chi-square.
  static constexpr double kMedians[] = {0.6745, 1.1774, 1.5382};
  static constexpr double kKnee = 1.5 / kMedians[0];  // in medians: 1.5 sigmas of one component
  double noise_ = 1;
  std::vector<double> sizes_;  // in medians
};

}  // namespace trigpoint
