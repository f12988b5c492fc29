// The record of a result, results/<stage>/<name>/manifest.json.
#pragma once

#include <string>

#include "datasets/project/project.h"

namespace trigpoint {

// Is there a manifest that is not what was written?
bool HasDamagedManifest(const Project& project, const std::string& stage, const std::string& name);

}  // namespace trigpoint
