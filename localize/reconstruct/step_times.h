// Wall time of the steps of a computation.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/memory.h"

namespace trigpoint {

// Wall time of each step, s, in order.
using StepSeconds = std::vector<std::pair<std::string, double>>;

// Appends the time since the last step to `seconds`, and gives back the memory that the step leaves free.
class StepTimes {
 public:
  explicit StepTimes(StepSeconds* seconds) : seconds_(seconds) {}
  void End(const char* name) {
    ReturnFreeMemory();
    const auto now = std::chrono::steady_clock::now();
    seconds_->emplace_back(name, std::chrono::duration<double>(now - start_).count());
    start_ = now;
  }

 private:
  StepSeconds* seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace trigpoint
