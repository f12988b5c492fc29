// Tables of a site's solution for people and other programs (docs/file_formats.md).
#pragma once

#include <filesystem>

#include "datasets/project/options_json.h"
#include "localize/site/adjust_site.h"

namespace trigpoint {

// runs.csv, panoramas.csv, panoramas_cov.csv, tags.csv; of each run, in a folder of its name, cameras.tum, cameras.csv,
// cameras_cov.csv. All in the site's ENU.
void WriteSiteTables(const SiteAdjustment& site, const std::filesystem::path& dir);

}  // namespace trigpoint
