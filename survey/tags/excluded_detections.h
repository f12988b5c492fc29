// The review laid over detections.
#pragma once

#include <string>
#include <vector>

#include "datasets/project/review.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// Without what the review excludes: detections, images, tags. What has an image without any left keeps its entry.
void LeaveOutExcluded(const Review& review, const std::string& run, std::vector<ImageDetections>& images);

}  // namespace trigpoint
