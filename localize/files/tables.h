// A localization as the files of docs/file_formats.md.
#pragma once

#include <filesystem>
#include <vector>

#include "datasets/io/csv.h"
#include "localize/files/job.h"
#include "localize/localize.h"

namespace trigpoint {

// odom_from_cam of the run's first camera, on the body's clock: that of odometry and GPS.
Trajectory FirstCameraTrajectory(const LocalizeInput& input, const Localization& result);

// cameras.tum, cameras.csv in the world, where the run is georeferenced; cameras_odom.tum where its poses in its own
// frame are given.
void WriteCameras(const LocalizeInput& input, const Localization& result, const std::filesystem::path& dir);
// Cells of these tables: x to qw; with the sigmas of the position; latitude, longitude, height, heading, pitch, roll.
void PutPose(CsvWriter& csv, const Rigid3d& target_from_x);
void PutWorldPose(CsvWriter& csv, const PoseEstimate& e);
void PutGeodeticPose(CsvWriter& csv, const LocalFrame& frame, const Rigid3d& world_from_x);

// cameras.tum, cameras_odom.tum, cameras.csv, views.csv, matches.csv.
void WriteLocalization(const Site& site, const LocalizeJob& job, const Localization& result,
                       const std::filesystem::path& dir);

// The solution, which is `result`'s, with panoramas.csv, its tables of covariances and its COLMAP model. Names the rows
// of panoramas.csv that the references belong to.
void WriteLocalizedSolution(const Site& site, const LocalizeJob& job, const Localization& result, Solution* solution,
                            const std::filesystem::path& dir);

// rigs.csv: every photo of every refined set, relative to its rig and in the world. Throws IoError.
void WriteRigs(const std::vector<SetRefinement>& sets, const Localization& result, const std::filesystem::path& dir);

}  // namespace trigpoint
