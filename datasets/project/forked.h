// A computation in a process of its own, for libraries that end the process where memory runs out.
#pragma once

#include <functional>
#include <string>

#include "calib/base/error.h"
#include "calib/base/progress.h"

namespace trigpoint {

// Memory ran out; with more of it the same may succeed.
class MemoryError : public Error {
 public:
  using Error::Error;
};

struct ForkedResult {
  std::string bytes;              // what the body returned
  int64_t peak_memory_bytes = 0;  // resident
};

// Runs `body` in a forked process and returns what it returns. Its progress and its errors arrive here as if it had
// run in this process. Where a signal ends it, an Error names `what`, the signal and what to do. Throws Cancelled
// after ending it. It ends with this process, however sudden. `body` may start threads, but must not touch what other
// threads of this process may hold locked.
ForkedResult RunForked(const std::string& what, const std::function<std::string(ProgressSink&)>& body,
                       ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
