// A computation in a process of its own, for libraries that end the process where memory runs out.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "calib/base/error.h"
#include "calib/base/progress.h"

namespace trigpoint {

// Memory ran out; with more of it the same may succeed.
class MemoryError : public Error {
 public:
  using Error::Error;
};

// What to say of an error that memory ran out (std::bad_alloc, OpenCV's, a thread that cannot be started) and what to
// do; nothing for other errors.
std::optional<std::string> OutOfMemory(const std::exception& error);

struct ForkedResult {
  std::string bytes;              // what the body returned
  int64_t peak_memory_bytes = 0;  // resident
};

// A computation in a forked process, while this one goes on. It ends with this process, however sudden. `body` may
// start threads, but must not touch what other threads of this process may hold locked.
class ForkedTask {
 public:
  using Body = std::function<std::string(ProgressSink&)>;
  // `what` names it in errors. A process that sleeps for `stuck` without using the processor waits for a lock that
  // another thread held during the fork: it is ended and begun anew, up to five times, with its progress. `body` must
  // own what it needs until then. Throws IoError where no process can be started.
  ForkedTask(std::string what, Body body, std::chrono::milliseconds stuck = std::chrono::seconds(10));
  ~ForkedTask();  // ends it
  ForkedTask(const ForkedTask&) = delete;
  ForkedTask& operator=(const ForkedTask&) = delete;

  // Hands on its progress; waits for it at most `patience`. True once it has ended.
  bool Listen(ProgressSink& progress, std::chrono::milliseconds patience);
  void Kill();
  // What it returned, once it has ended. Its errors arrive here as if it had run in this process. Where a signal ended
  // it, an Error names `what`, the signal and what to do.
  ForkedResult Take();

 private:
  class Listener;
  void Begin();
  void End();
  bool IsStuck();

  std::string what_;
  Body body_;
  std::chrono::milliseconds stuck_;
  int attempts_ = 0;
  std::optional<int64_t> ticks_asleep_;            // when it was asked last
  std::chrono::steady_clock::time_point changed_;  // since then it sleeps without using the processor
  pid_t child_ = -1;
  std::unique_ptr<Listener> listener_;
};

// Waits for a ForkedTask. Throws Cancelled after ending it.
ForkedResult RunForked(const std::string& what, const ForkedTask::Body& body, ProgressSink& progress,
                       const CancelToken& cancel, std::chrono::milliseconds stuck = std::chrono::seconds(10));

}  // namespace trigpoint
