#include "datasets/io/photo_sets.h"

#include <algorithm>

#include "datasets/io/exif.h"

namespace trigpoint {

std::vector<std::filesystem::path> PhotoSetFolders(const std::filesystem::path& site_dir) {
  std::vector<std::filesystem::path> sets;
  std::error_code ignored;
  for (std::filesystem::directory_iterator it(site_dir / "photos", ignored), end; it != end; it.increment(ignored)) {
    if (it->is_directory(ignored) && it->path().filename().string().front() != '.' && !PicturesIn(it->path()).empty()) {
      sets.push_back(it->path());
    }
  }
  std::sort(sets.begin(), sets.end());
  if (!sets.empty()) return sets;
  for (const char* known : {"runs", "panoramas", "panoramas.csv", "photos.csv", "control_points.csv"}) {
    if (std::filesystem::exists(site_dir / known)) return sets;
  }
  if (!PicturesIn(site_dir).empty()) {
    const std::filesystem::path dir = std::filesystem::absolute(site_dir).lexically_normal();
    sets.push_back(dir.has_filename() ? dir : dir.parent_path());
  }
  return sets;
}

}  // namespace trigpoint
