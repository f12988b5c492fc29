#include "calib/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace trigpoint {

int ResolveThreads(int threads) {
  if (threads > 0) return threads;
  return std::max(1U, std::thread::hardware_concurrency());
}

void ParallelFor(int64_t n, int threads, const CancelToken& cancel, const std::function<void(int64_t)>& body) {
  const int workers = static_cast<int>(std::min<int64_t>(ResolveThreads(threads), n));
  std::atomic<int64_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (int64_t i = next++; i < n; i = next++) {
        cancel.ThrowIfCancelled();
        body(i);
      }
    } catch (...) {  // carried to the calling thread below, never swallowed
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
      next = n;
    }
  };
  {
    std::vector<std::jthread> pool;
    for (int w = 1; w < workers; ++w) pool.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace trigpoint
