// What of a site's folder is input, and what of it serves for nothing.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

struct Site;

// ReadSite, to be looked at: of what is broken each reason goes to `problems` and the rest is read. A run whose
// settings are broken is one of Site::broken_runs. Throws InputError only if there is no such folder.
Site ReadSiteTolerant(const std::filesystem::path& dir, std::vector<std::string>* problems);

// Would a site's reader take a file at this path, relative to the site, as its user's input? It need not be there.
bool IsInputPath(const std::filesystem::path& relative);

// Of each table of a site that is there and gives nothing (no row, or none that can be used): file and why. `runs`:
// those whose gps.csv is looked at, too.
std::vector<std::string> UnusedTables(const std::filesystem::path& site_dir, const std::vector<std::string>& runs = {});

}  // namespace trigpoint
