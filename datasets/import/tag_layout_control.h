// A known layout of tags as control of the survey.
#pragma once

#include <filesystem>

#include "datasets/import/colmap_run.h"

namespace trigpoint {

// Writes SITE/control_points.csv (the four corners of each tag, local x_m, y_m, z_m) and SITE/tags.yaml (family and
// sizes) from a layout (datasets/io/tag_layout.h). `size_m`: of tags whose size the layout doesn't state. Throws
// InputError if one of the files is there, sizes are missing or families are mixed.
ImportReport ImportTagLayout(const std::filesystem::path& site, const std::filesystem::path& file, double size_m);

}  // namespace trigpoint
