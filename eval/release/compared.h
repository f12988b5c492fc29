// Two or more projects, releases or variants side by side.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/errors/compare.h"

namespace trigpoint {

// One side of a comparison.
struct Compared {
  std::string label;                             // as the user wrote it
  std::vector<ErrorRow> rows;                    // of one variant
  std::map<std::string, nlohmann::json> stages;  // "localize/run1" -> manifest
  std::vector<TagResult> tags;                   // of its map; empty: none
  std::filesystem::path map;                     // where that lies, of a project
  std::vector<std::string> notes;                // what could not be read, one sentence each
};

// `written`: a project's folder, a release's, one with errors.csv, or any with @VARIANT behind it. Throws InputError.
Compared OpenCompared(const std::string& written);

// What differs between two sides in inputs, options and versions of their stages, one line each.
std::vector<std::string> ChangesBetween(const Compared& a, const Compared& b);

}  // namespace trigpoint
