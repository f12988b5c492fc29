// The stage behind `trigpoint reconstruct`: each run by itself, once, for all that extend or read it.
#pragma once

#include <optional>
#include <string>

#include "app/pipeline/stages.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

// trigpoint or paper: how a variant's runs are reconstructed and localized. It is an option of localize.
std::string ModeOf(const Project& project, const StageTarget& target);

// The manifest of the reconstruction that the stage `reader` reads for `target`.
std::filesystem::path ReconstructionManifest(const Project& project, const std::string& reader,
                                             const StageTarget& target);

// That reconstruction. Throws InputError if there is none.
Solution ReadReconstruction(const Project& project, const std::string& reader, const StageTarget& target);

// Why that reconstruction refused the run's odometry as it is now; nothing if it did not.
std::optional<std::string> WhyOdometryIsRefused(const Project& project, const std::string& reader,
                                                const StageTarget& target);

}  // namespace trigpoint
