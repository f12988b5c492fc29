// Corners of tags in images of rolling shutters.
#pragma once

#include <vector>

#include "datasets/io/site.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// Moves corners to where a camera at the image's time would have seen them (calib/camera/rolling_shutter.h), in the
// images of cameras with a readout time. The size of a tag gives its distance; without a size only the camera's
// rotation is corrected, without odometry at the image's time nothing.
void MoveToImageTimes(const Run& run, const TagSizes& sizes, std::vector<ImageDetections>* images);

}  // namespace trigpoint
