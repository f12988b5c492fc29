// The embedded example site, as a project of one's own.
#pragma once

#include <filesystem>

namespace trigpoint {

// Copies the site into the new folder `dir`, completely or not at all, and writes its trigpoint.yaml. Where the folder
// is that project already, nothing is done. Throws InputError for a folder that is something else, IoError.
void MakeDemoSite(const std::filesystem::path& dir);

}  // namespace trigpoint
