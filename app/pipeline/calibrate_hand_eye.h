// calibrate --hand-eye RUN: how a run's camera sits on its body, from the run's odometry and the tags it saw.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/target/hand_eye.h"
#include "datasets/io/site.h"
#include "datasets/project/stage.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

// The files it reads: the run's, tags.yaml, and the detections, of which results/detect/<run> must be there unless the
// run brings its own.
std::vector<std::filesystem::path> HandEyeInputs(const Project& project, const std::string& run);

// The tags in a camera's images, each with odometry's pose at the moment that the image shows (the camera's time shift
// added). Images outside odometry's time are left out and counted. Throws InputError for a tag without a size.
std::vector<HandEyeSight> HandEyeSights(const Run& run, const BodyCamera& camera, const TagSizes& sizes,
                                        const std::vector<ImageDetections>& images, int* without_odometry);

// Writes camchain.yaml and the other camera files, calibration.json, quality.md.
void CalibrateHandEyeOfRun(const std::string& run, const HandEyeOptions& options, StageContext& context);

}  // namespace trigpoint
