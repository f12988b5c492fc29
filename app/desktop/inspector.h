// What a solution says about a run's images and points, read once and shared by the desks' background work.
#pragma once

#include <mutex>
#include <string>

#include "app/pipeline/inspect.h"

namespace trigpoint {

struct SharedInspector {
  SharedInspector(const Project& project, const std::string& run, const std::string& variant)
      : inspector(project, run, variant) {}
  std::mutex mutex;  // one at a time may read
  RunInspector inspector;
};

}  // namespace trigpoint
