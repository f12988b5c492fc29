// What of a site's folder is input, and what of it serves for nothing.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

// Would a site's reader take a file at this path, relative to the site, as its user's input? It need not be there.
bool IsInputPath(const std::filesystem::path& relative);

// Of each table of a site that is there and gives nothing (no row, or none that can be used): file and why.
std::vector<std::string> UnusedTables(const std::filesystem::path& site_dir);

}  // namespace trigpoint
