// Symbolic links in a folder that is imported: what is taken in must lie in that folder, which others may have made.
#pragma once

#include <filesystem>

namespace trigpoint {

// Throws InputError if `file`, which lies below `root`, leads out of it by a link. `root` itself may be reached through
// one. A file that is not there passes.
void RequireInside(const std::filesystem::path& root, const std::filesystem::path& file);

// The same of the files that lie in `root` itself, as those of a COLMAP model or a bag. A `root` that is a file passes.
void RequireFilesInside(const std::filesystem::path& root);

// The same of everything below `root`.
void RequireAllInside(const std::filesystem::path& root);

}  // namespace trigpoint
