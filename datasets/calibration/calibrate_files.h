// What the stage `calibrate` writes.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/target/quality.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/io/site.h"
#include "datasets/project/stage.h"

namespace trigpoint {

// A picture in which no board was found, or that could not be read.
struct LeftOutPicture {
  std::string camera, image, reason;
};

// Model, parameters with their standard deviations, residuals of one camera.
nlohmann::json CameraJson(const CalibratedCamera& camera);

// Everything but the camera files: calibration.json, views.csv, residuals.csv, maps as CSV and PNG, quality.md.
void WriteCalibration(const std::filesystem::path& out, const CalibrationInput& input, const Calibration& calibration,
                      const Quality& quality, const std::vector<LeftOutPicture>& left_out);

// The cameras in every form others read: camchain.yaml (camchain_refused.yaml, and no other, if the calibration is not
// to be used), and per camera OpenCV's and ROS' YAML, and COLMAP's cameras.txt.
void WriteCameraFiles(const std::filesystem::path& out, const std::vector<BodyCamera>& cameras,
                      const std::vector<std::string>& comments, bool refused);
std::vector<BodyCamera> AsCamchain(const Calibration& calibration);

// calibration.json of cameras that were read from `file`. Returns the list of cameras for the metrics.
nlohmann::json WriteImport(const std::filesystem::path& out, const std::filesystem::path& file,
                           const CameraFile& cameras);

// What a person reads on the command line.
std::string CalibrationSummary(const StageOutcome& outcome);

}  // namespace trigpoint
