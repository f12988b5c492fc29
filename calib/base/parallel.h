// A parallel loop whose results do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <functional>

#include "calib/base/progress.h"

namespace trigpoint {

// Number of workers for an option value: 0 means all cores.
int ResolveThreads(int threads);

// Calls body(i) for every i in [0, n) on up to `threads` workers (0: all cores). Order is unspecified;
// write results by index. The first exception is rethrown after all workers have stopped. Polls `cancel`.
void ParallelFor(int64_t n, int threads, const CancelToken& cancel, const std::function<void(int64_t)>& body);

// The same where results are taken in order: make(i) on the workers, then use(i) for i = 0, 1, ..., one at a time.
// At most `ahead` items are made or being made beyond the last one used, which bounds what waits in memory.
void ParallelInOrder(int64_t n, int threads, int64_t ahead, const CancelToken& cancel,
                     const std::function<void(int64_t)>& make, const std::function<void(int64_t)>& use);

}  // namespace trigpoint
