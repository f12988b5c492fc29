// Pictures of a calibration: 8-bit BGR, ready to be written.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "calib/target/quality.h"

namespace trigpoint {

// A value over the picture in colours, with a scale and the values at nine places. NaN is grey.
cv::Mat DrawMap(const ImageGrid& grid, const std::vector<double>& values, const std::vector<bool>& covered, int width,
                int height, const std::string& title, const std::string& unit);

// Where the board's points lay in the picture, and which parts are empty.
cv::Mat DrawCoverage(const CalibrationInput& input, const Calibration& calibration, const Coverage& coverage,
                     int camera);

// Four views of the residuals: every one as an arrow, their mean over parts of the picture, their distribution against
// the normal one, and their radial part against the distance from the principal point.
cv::Mat DrawResiduals(const CalibrationInput& input, const Calibration& calibration, const ResidualPattern& pattern,
                      int camera);

}  // namespace trigpoint
