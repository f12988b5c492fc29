// Of what a result was computed by.
#pragma once

#include <nlohmann/json.hpp>

namespace trigpoint {

// {"trigpoint": "0.9.0", "compiler": ..., "system": ..., "processor": ..., "libraries": {"Ceres": "2.1.0", ...}}: as
// this program was built and runs.
nlohmann::json ProgramVersions();

}  // namespace trigpoint
