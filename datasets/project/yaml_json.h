// YAML values as JSON, the form in which options travel.
#pragma once

#include <yaml-cpp/node/node.h>

#include <nlohmann/json.hpp>
#include <string>

namespace trigpoint {

// Plain scalars become null, bool, integer or number where they look like one; quoted ones stay text.
nlohmann::json JsonFromYaml(const YAML::Node& node);

// One value, as written behind `--set key=`.
nlohmann::json JsonFromYamlText(const std::string& text);

}  // namespace trigpoint
