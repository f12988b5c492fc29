// What the results say of a calibration, for the calibration desk. No Qt here.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trigpoint {

struct CalibrationPoint {
  double u = 0, v = 0;    // observed, px
  double du = 0, dv = 0;  // predicted - observed, px
  bool used = true;
};

struct CalibrationParameter {
  std::string name;
  double value = 0, sigma = 0;  // 1 sigma
};

struct CalibrationCamera {
  std::string name, model;
  int width = 0, height = 0;
  double rms_px = 0;
  int views = 0, views_used = 0;
  std::vector<CalibrationParameter> parameters;
  std::vector<CalibrationPoint> points;
  // Points in each cell of a grid over the image, row by row.
  int columns = 0, rows = 0;
  std::vector<int> coverage;
  // Mean size of the residuals in each cell, px; zero where there are none.
  std::vector<double> residual_px;
  std::vector<std::string> next;      // findings, and what to photograph next, one sentence each
  std::filesystem::path uncertainty;  // the map that the stage drew
};

struct CalibrationSheet {
  std::vector<CalibrationCamera> cameras;
  std::vector<std::string> problems;
};

// Reads results/calibrate/<name>; what is missing is left out, what is broken is named.
CalibrationSheet LoadCalibration(const std::filesystem::path& result);
// Names of the calibrations of a project.
std::vector<std::string> CalibrationNames(const std::filesystem::path& results);

}  // namespace trigpoint
