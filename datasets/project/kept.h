// The result before the last decision of the review, which RunStage keeps beside the present one: taken back, it is
// there at once.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace trigpoint {

class Project;

// Its manifest; nothing if there is none that can be read.
std::optional<nlohmann::json> ReadKept(const Project& project, const std::string& stage, const std::string& name);

}  // namespace trigpoint
