// When an interval is worth printing.
#pragma once

#include "eval/statistics/bootstrap.h"

namespace trigpoint {

// An interval of a positive quantity over more than two powers of ten says that the data are too few, and nothing else.
constexpr double kWidestInterval = 100;
inline bool IsInformative(const Interval& interval) { return interval.high <= kWidestInterval * interval.low; }

}  // namespace trigpoint
