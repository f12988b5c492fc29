// What a hand-eye calibration works on, of a run's detections.
#pragma once

#include <vector>

#include "calib/target/hand_eye.h"
#include "datasets/io/site.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// The tags in a camera's images, each with odometry's pose at the moment that the image shows (the camera's time shift
// added). Images outside odometry's time are left out and counted. Throws InputError for a tag without a size.
std::vector<HandEyeSight> HandEyeSights(const Run& run, const BodyCamera& camera, const TagSizes& sizes,
                                        const std::vector<ImageDetections>& images, int* without_odometry);

}  // namespace trigpoint
