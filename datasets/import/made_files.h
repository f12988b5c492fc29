// What an import has made so far: taken away again unless the import is completed, so that a failed one leaves nothing.
#pragma once

#include <filesystem>
#include <vector>

namespace trigpoint {

class MadeFiles {
 public:
  MadeFiles() = default;
  MadeFiles(const MadeFiles&) = delete;
  MadeFiles& operator=(const MadeFiles&) = delete;
  // Removes what was named, last first; folders only where they are empty.
  ~MadeFiles() {
    std::error_code ignored;
    for (auto path = made_.rbegin(); path != made_.rend(); ++path) std::filesystem::remove(*path, ignored);
  }
  // To be called before `path` is written: it and its missing folders are remembered. Returns `path`; what is there
  // already is not remembered.
  const std::filesystem::path& Making(const std::filesystem::path& path) {
    std::error_code ignored;
    if (path.empty() || std::filesystem::exists(std::filesystem::symlink_status(path, ignored))) return path;
    Making(path.parent_path());
    made_.push_back(path);
    return path;
  }
  void Keep() { made_.clear(); }

 private:
  std::vector<std::filesystem::path> made_;
};

}  // namespace trigpoint
