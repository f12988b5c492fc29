// What a solution says about a run's images and points, read once and shared by the desks' background work.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "app/pipeline/drawn_views.h"
#include "datasets/project/reference_parts.h"
#include "eval/inspect/run_inspector.h"

namespace trigpoint {

struct SharedInspector {
  SharedInspector(const Project& opened, const std::string& run, const std::string& variant)
      : project(opened), inspector(opened, run, variant) {}
  std::vector<InspectedMatch> Matches(const std::string& file, const std::string& panorama) {
    return inspector.Matches(file, panorama, ReferenceResults(project), ViewOptionsOf(project));
  }
  const Project project;
  std::mutex mutex;  // one at a time may read
  RunInspector inspector;
};

}  // namespace trigpoint
