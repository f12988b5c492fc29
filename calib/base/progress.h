// Progress and cancellation, passed beside options to every long computation.
#pragma once

#include <atomic>
#include <cstdint>
#include <string_view>

#include "calib/base/error.h"

namespace trigpoint {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

// Receives progress from a computation. Thread safe: any worker may call it.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;
  // A new task of `total` steps (0: unknown) begins; it replaces the one before.
  virtual void Begin(std::string_view /*task*/, int64_t /*total*/) {}
  virtual void Advance(int64_t /*steps*/) {}
  // A sentence for the log; warnings also end up in the manifest.
  virtual void Log(LogLevel /*level*/, std::string_view /*text*/) {}
};

// Set from a signal handler or another thread; computations poll it at least every 0.2 s of work.
class CancelToken {
 public:
  void Cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool IsCancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  void ThrowIfCancelled() const {
    if (IsCancelled()) throw Cancelled();
  }

 private:
  std::atomic<bool> cancelled_{false};
};

}  // namespace trigpoint
