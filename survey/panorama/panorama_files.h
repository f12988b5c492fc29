// The panorama of a stitched photo set as a picture, and what the stitching found in numbers.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "survey/panorama/composite.h"
#include "survey/panorama/stitch.h"

namespace trigpoint {

// Photos taken along a walk match at most by chance; stitching them would give a panorama that is wrong. Throws
// InputError for these.
void RequireOneSpot(const PhotoSet& set, const std::filesystem::path& dir);

// `given`: photos of the set, used or not.
nlohmann::json StitchMetrics(const StitchedRig& rig, int given);

// Composes the photos into `file` with what viewers need to know, and coverage.png beside it. Throws IoError.
Composite WritePanorama(const StitchedRig& rig, const CompositeOptions& options, const std::filesystem::path& file,
                        int threads, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
