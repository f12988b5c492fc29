// Another program run on our behalf. It never outlives us: Ctrl-C ends it, and so does our own death, however sudden.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/progress.h"

namespace trigpoint {

struct ChildResult {
  int exit_code = -1;  // 128 + signal, if a signal ended it
  double wall_seconds = 0;
  double cpu_seconds = 0;  // user and system
  double peak_mib = 0;
  std::string last_line;  // of its output, for messages
};

// The program's full path in PATH, or empty.
std::filesystem::path FindProgram(const std::string& name);

// Runs argv (argv[0] a full path) with its output appended to `log`. Throws Cancelled after ending it when cancelled,
// IoError when it cannot be started. A program that takes longer than `timeout_s` (0: any time) is ended: exit code
// 137.
ChildResult RunChild(const std::vector<std::string>& argv, const std::filesystem::path& log, double timeout_s,
                     const CancelToken& cancel);

}  // namespace trigpoint
