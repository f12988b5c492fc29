// The tags in every image of a run.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/io/site.h"
#include "datasets/project/stage.h"
#include "survey/tags/detection.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// Finds them; what masks hide and what the views of a 360 picture repeat is left out. Names images that cannot be used
// in the log, and adds what was found to the metrics. Throws InputError where no image can be used, Error.
std::vector<ImageDetections> DetectInRun(const Run& run, const DetectTagsOptions& options, StageContext& context);

// One picture of each image of the run with a tag: what was found in it. Throws IoError.
void WriteOverlays(const Run& run, const std::vector<ImageDetections>& images, const std::filesystem::path& dir,
                   int threads, ProgressSink& progress, const CancelToken& cancel);

// Leaves out tags that the run's own detections have of other families than `families`: the same number in another
// family is another tag. Throws InputError where all are.
void LeaveOutOtherFamilies(const Run& run, const std::string& families, ProgressSink& progress,
                           std::vector<ImageDetections>* images);

}  // namespace trigpoint
