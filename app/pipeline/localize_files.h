// From a site's files to the localization's input, and from its result to the files of docs/file_formats.md.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "datasets/io/csv.h"
#include "localize/localize.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {

// What stitching knows of a photo set's rig beyond its views.
struct StitchedShape {
  Eigen::MatrixXd covariance;  // of all views' [turn (rad), centre (m)] if the rig's size were known
  double log_scale_sigma = 0;  // 1 sigma of ln(size)
};

// Input of one run with its GPS; holds the feature stores open.
struct LocalizeJob {
  LocalizeInput input;
  std::vector<GpsPlace> gps;
  std::vector<PreparedReference> references;  // as input.references
  std::map<int, StitchedShape> shapes;        // of those that are a whole photo set: index into references
  std::vector<std::string> warnings;
  int without_odometry = 0;  // images skipped
  int without_features = 0;
};

// The run alone: images with features, and with odometry if the run has any (else every pose is the identity). Throws
// as below.
LocalizeJob MakeRunJob(const Run& run, const std::filesystem::path& run_features);
// `rigs`: folders of stitched rigs by the name of their photo set; a set with one is one reference of many views, else
// every photo is one of its own. `reference_results`: folders of all parts of the references. Throws InputError if
// nothing can be localized (no odometry, no image with it).
LocalizeJob MakeLocalizeJob(const Site& site, const Run& run, bool has_frame, const LocalFrame& frame,
                            const std::filesystem::path& run_features,
                            const std::vector<std::filesystem::path>& reference_results, const ViewOptions& views,
                            const std::map<std::string, std::filesystem::path>& rigs = {});

// odom_from_cam of the run's first camera, on the body's clock: that of odometry and GPS.
Trajectory FirstCameraTrajectory(const LocalizeJob& job, const Localization& result);

// cameras.tum, cameras.csv in the world, where the run is georeferenced; cameras_odom.tum where its poses in its own
// frame are given.
void WriteCameras(const LocalizeInput& input, const Localization& result, const std::filesystem::path& dir);
// Cells of these tables: x to qw with the sigmas of the position; latitude, longitude, height, heading, pitch, roll.
void PutWorldPose(CsvWriter& csv, const PoseEstimate& e);
void PutGeodeticPose(CsvWriter& csv, const LocalFrame& frame, const Rigid3d& world_from_x);

// cameras.tum, cameras_odom.tum, cameras.csv, panoramas.csv, views.csv, matches.csv.
void WriteLocalization(const Site& site, const LocalizeJob& job, const Localization& result,
                       const std::filesystem::path& dir);

}  // namespace trigpoint
