// calibrate --hand-eye RUN: how a run's camera sits on its body, from the run's odometry and the tags it saw.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/target/hand_eye.h"
#include "datasets/project/stage.h"

namespace trigpoint {

// The files it reads: the run's, tags.yaml, and the detections, of which results/detect/<run> must be there unless the
// run brings its own.
std::vector<std::filesystem::path> HandEyeInputs(const Project& project, const std::string& run);

// Writes camchain.yaml and the other camera files, calibration.json, quality.md.
void CalibrateHandEyeOfRun(const std::string& run, const HandEyeOptions& options, StageContext& context);

}  // namespace trigpoint
