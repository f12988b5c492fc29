// What two results were made of, compared: stage version, options, inputs, seed.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace trigpoint {

struct Difference {
  std::string what;  // "options.tracks.ratio", "inputs.runs/run1/odometry.tum", "version"
  std::string a, b;  // as JSON; empty: not there. Of inputs: the first digits of their hashes
};

// By the manifests of both; ordered by name. Times and places differ always and are left out.
std::vector<Difference> DifferencesOf(const nlohmann::json& manifest_a, const nlohmann::json& manifest_b);
// The manifest in a result's folder; null if there is none that can be read.
nlohmann::json ManifestIn(const std::filesystem::path& result);

}  // namespace trigpoint
