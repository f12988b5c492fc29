// From a site's files to the localization's input, and from its result to the files of docs/file_formats.md.
#pragma once

#include <filesystem>
#include <memory>

#include "app/pipeline/feature_store.h"
#include "localize/localize.h"

namespace trigpoint {

// Input of one run with its GPS; holds the feature stores open.
struct LocalizeJob {
  LocalizeInput input;
  std::vector<GpsPlace> gps;
  std::vector<PreparedReference> references;  // as input.references
  std::vector<std::string> warnings;
  int without_odometry = 0;  // images skipped
  int without_features = 0;
};

// Throws InputError if nothing can be localized (no odometry, no image with it).
LocalizeJob MakeLocalizeJob(const Site& site, const Run& run, bool has_frame, const LocalFrame& frame,
                            const std::filesystem::path& run_features, const std::filesystem::path& reference_features,
                            const ViewOptions& views);

// odom_from_cam of the run's first camera, in image time.
Trajectory FirstCameraTrajectory(const LocalizeJob& job, const Localization& result);

// cameras.tum, cameras_odom.tum, cameras.csv, panoramas.csv, views.csv, sparse/.
void WriteLocalization(const Site& site, const LocalizeJob& job, const Localization& result,
                       const std::filesystem::path& dir);

}  // namespace trigpoint
