#include "datasets/import/source_links.h"

#include "calib/base/error.h"

namespace trigpoint {

namespace fs = std::filesystem;

void RequireInside(const fs::path& root, const fs::path& file) {
  std::error_code no_root, no_file;
  const fs::path folder = fs::canonical(root.empty() ? "." : root, no_root), target = fs::canonical(file, no_file);
  if (no_root || no_file) return;
  const fs::path inside = target.lexically_relative(folder);
  if (!inside.empty() && *inside.begin() != "..") return;
  throw InputError(file.string() + ": expected a file in " + folder.string() + ", found a link out of it, to " +
                   target.string() + "; copy the file in its place");
}

void RequireFilesInside(const fs::path& root) {
  std::error_code ignored;
  for (fs::directory_iterator entry(root, ignored), end; entry != end; entry.increment(ignored)) {
    if (!entry->is_directory(ignored)) RequireInside(root, entry->path());
  }
}

void RequireAllInside(const fs::path& root) {
  for (const auto& entry : fs::recursive_directory_iterator(root, fs::directory_options::skip_permission_denied)) {
    if (entry.is_symlink()) RequireInside(root, entry.path());
  }
}

}  // namespace trigpoint
