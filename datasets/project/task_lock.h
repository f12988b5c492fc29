// Tasks of a batch, on this machine or on others, make different results of one project at the same time.
#pragma once

#include <filesystem>
#include <string>

#include "datasets/project/lock.h"

namespace trigpoint {

// While a task holds it, nobody has the project alone (ProjectLock), and nobody else makes the same result. Locks of
// the kernel on results/.lock, shared, and on results/.locks/<result>: they end with their process however that ends.
// On a shared file system they hold between machines where it passes locks on (NFS 4, Lustre with flock).
class TaskLock {
 public:
  // `result`: "localize/run1". Waits for one who has the project alone, and for another maker of the result, up to
  // `patience_s`, which covers the time a file server takes to notice that a machine is lost; then throws IoError
  // naming the holder. Removes what a killed maker of the result left.
  TaskLock(const std::filesystem::path& results, const std::string& result, double patience_s = kPatience_s);
  ~TaskLock();
  TaskLock(const TaskLock&) = delete;
  TaskLock& operator=(const TaskLock&) = delete;

  // Is a task making this result now? Never creates or changes anything.
  static bool IsHeld(const std::filesystem::path& results, const std::string& result);

 private:
  static constexpr double kPatience_s = 300;
  int project_fd_ = -1, result_fd_ = -1;
};

// This machine, as locks name it.
std::string HostName();

}  // namespace trigpoint
