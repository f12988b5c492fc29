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
  // Of a residual of this size (in stated sigmas, >= 0), which counts for the next round.
  double Weight(double size) {
    sizes_.push_back(size);
    const double scaled = size / noise_;
    return scaled > kKnee ? kKnee / scaled : 1;
  }
  void EndRound() {
    constexpr double kMedianOfNormal = 0.6745;
    noise_ = std::max(1.0, Median(std::exchange(sizes_, {})) / kMedianOfNormal);
  }
  double noise() const { return noise_; }  // in stated sigmas, >= 1

 private:
  static constexpr double kKnee = 1.5;
  double noise_ = 1;
  std::vector<double> sizes_;
};

}  // namespace trigpoint
