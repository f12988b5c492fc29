#include "calib/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
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

void ParallelInOrder(int64_t n, int threads, int64_t ahead, const CancelToken& cancel,
                     const std::function<void(int64_t)>& make, const std::function<void(int64_t)>& use) {
  using std::chrono_literals::operator""ms;
  std::mutex mutex;
  std::condition_variable moved;
  std::vector<bool> made(static_cast<size_t>(n));
  int64_t head = 0;  // the next one to be used
  bool using_one = false, failed = false;
  ParallelFor(n, threads, cancel, [&](int64_t i) {
    std::unique_lock lock(mutex);
    // A cancelled worker leaves an item unmade that others may wait for: they look, too.
    while (!failed && i >= head + ahead) {
      cancel.ThrowIfCancelled();
      moved.wait_for(lock, 100ms);
    }
    if (failed) return;
    try {
      lock.unlock();
      make(i);
      lock.lock();
      made[static_cast<size_t>(i)] = true;
      if (using_one) return;  // who uses one goes on with this
      using_one = true;
      while (head < n && made[static_cast<size_t>(head)]) {
        lock.unlock();
        use(head);
        lock.lock();
        ++head;
        moved.notify_all();
      }
      using_one = false;
    } catch (...) {
      if (!lock.owns_lock()) lock.lock();
      failed = true;
      moved.notify_all();
      throw;
    }
  });
}

}  // namespace trigpoint
