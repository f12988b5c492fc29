#include "datasets/io/motion_rates.h"

#include <algorithm>
#include <cmath>

#include "calib/base/median.h"

namespace trigpoint {
namespace {

// Poses nearer in time say more of their noise than of the motion: about the time that a sensor needs for its rows.
constexpr int64_t kShortest_ns = 20'000'000;
// Over longer steps nobody knows how a hand-held body moved in between.
constexpr int64_t kLongest_ns = 500'000'000;

int64_t StepOf(const Trajectory& trajectory) {
  std::vector<double> steps;
  for (size_t i = 1; i < trajectory.poses.size(); ++i) {
    steps.push_back(static_cast<double>(trajectory.poses[i].stamp_ns - trajectory.poses[i - 1].stamp_ns));
  }
  return steps.empty() ? kLongest_ns + 1 : std::max<int64_t>(kShortest_ns, std::llround(Median(steps)));
}

}  // namespace

std::vector<MotionRate> RatesAt(const Trajectory& trajectory, const std::vector<int64_t>& stamps) {
  std::vector<MotionRate> rates(stamps.size());
  const int64_t step = StepOf(trajectory);
  if (step > kLongest_ns) return rates;
  for (size_t i = 0; i < stamps.size(); ++i) {
    const auto at = trajectory.At(stamps[i], 2 * kLongest_ns);
    if (!at) continue;
    const auto before = trajectory.At(stamps[i] - step, 2 * kLongest_ns),
               after = trajectory.At(stamps[i] + step, 2 * kLongest_ns);
    if (!before && !after) continue;
    const int64_t span = (before ? step : 0) + (after ? step : 0);
    rates[i] = RateBetween(before.value_or(*at), after.value_or(*at), *at, 1e-9 * static_cast<double>(span));
  }
  return rates;
}

}  // namespace trigpoint
