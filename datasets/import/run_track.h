// Where a run went, to look for panoramas there.
#pragma once

#include <filesystem>
#include <string>

#include "datasets/import/panorama_provider.h"

namespace trigpoint {

// Points of the run's GPS (a file, or EXIF positions of its images), without it of its localized cameras
// (SITE/results/localize/<run>/cameras.csv), no closer than a quarter of `radius_m`. The radius is widened by twice the
// median 1 sigma of those positions. Throws InputError if there is neither.
SearchArea AreaAlongRun(const std::filesystem::path& site, const std::string& run, double radius_m);

}  // namespace trigpoint
