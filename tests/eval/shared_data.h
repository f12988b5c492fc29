// Data that is not part of the repository: TRIGPOINT_SHARED_DATA, or the folder ../shared/data beside it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace trigpoint {

inline std::optional<std::filesystem::path> SharedData(const std::string& folder) {
  const char* set = std::getenv("TRIGPOINT_SHARED_DATA");
  const std::filesystem::path dir = std::filesystem::path(set != nullptr ? set : "../shared/data") / folder;
  if (!std::filesystem::exists(dir)) return std::nullopt;
  return dir;
}

}  // namespace trigpoint
