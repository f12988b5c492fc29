// How `check` goes on, once or as long as a folder grows: the same for the command line and the window.
#pragma once

#include <functional>

#include "eval/intake/check.h"

namespace trigpoint {

// Looks at all that is there and writes results/check. `watched`: the page refreshes itself, since WatchSite follows.
// Lengths on the page are in `unit`.
CheckOutcome CheckSite(SiteCheck& check, const DisplayUnit& unit, bool watched, ProgressSink& progress,
                       const CancelToken& cancel);

// Called after each judgement, in the caller's thread; `looked`: pictures and pairs since the one before.
using Judged = std::function<void(const CheckOutcome& outcome, size_t looked)>;

// Goes on from `outcome` until it is cancelled, which is how a watch ends; returns the last judgement. Judges when
// something changed, and no more often than a third of the time, since pictures come first. Writes results/check each
// time. Throws InputError, IoError.
CheckOutcome WatchSite(SiteCheck& check, const DisplayUnit& unit, CheckOutcome outcome, ProgressSink& progress,
                       const CancelToken& cancel, const Judged& judged);

}  // namespace trigpoint
