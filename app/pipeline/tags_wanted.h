// Is anything to be done with the tags that a run's images may show?
#pragma once

#include <filesystem>

#include "datasets/project/project.h"

namespace trigpoint {

inline bool WantsTags(const Project& project, const std::string& run) {
  const Site& site = project.site();
  if (!site.stations.empty() || std::filesystem::exists(project.dir() / "tags.yaml")) return true;
  for (const Run& r : site.runs) {
    if (r.name == run) return !r.detections.empty();
  }
  return true;  // a run that cannot be read fails with its reason
}

}  // namespace trigpoint
