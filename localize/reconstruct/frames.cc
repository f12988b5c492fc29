#include "localize/reconstruct/frames.h"

#include "calib/base/median.h"

namespace trigpoint {

double MedianStep(const LocalizeInput& input) {
  std::vector<double> steps;
  for (size_t i = 1; i < input.odom_from_body.size(); ++i) {
    steps.push_back((input.odom_from_body[i].translation - input.odom_from_body[i - 1].translation).norm());
  }
  return Median(std::move(steps));
}

}  // namespace trigpoint
