// Where hand-held photo sets lie.
#pragma once

#include <filesystem>
#include <vector>

namespace trigpoint {

// The folders below `site_dir`/photos that hold at least one picture, by name; without any, the folder itself if it
// holds pictures and no runs, panoramas or tables of a site: a plain folder of photos.
std::vector<std::filesystem::path> PhotoSetFolders(const std::filesystem::path& site_dir);

}  // namespace trigpoint
