// A run's reconstruction from its files: conventions, calibration and places of its cameras are checked, motion and
// lenses that nobody gave are found.
#pragma once

#include <filesystem>
#include <string>

#include "datasets/project/stage.h"
#include "localize/files/job.h"
#include "localize/reconstruct/reconstruct_run.h"

namespace trigpoint {

// What a RefusedInput names where images contradict odometry.
inline constexpr const char* kRefusedOdometry = "odometry";

struct ReconstructedRun {
  LocalizeJob job;
  RunReconstruction reconstruction;
};

// `features`: the run's database. `mode`: trigpoint or paper. Writes the motion and the cameras that were found
// (localize/reconstruct/image_motion.h) to the context's folder, warns, and adds to its metrics. Throws InputError for
// what the images contradict, RefusedInput for odometry.
ReconstructedRun ReconstructFiles(Run run, const std::filesystem::path& features, const ReconstructRunOptions& options,
                                  const std::string& mode, StageContext& context);

}  // namespace trigpoint
