// How well a calibrated camera projects, over the whole picture, and how two calibrations differ.
//
// Two cameras whose rays differ by a rotation are the same camera, held differently: whoever uses the camera estimates
// its attitude. So both functions ask how a far point's pixel moves after the rotation that best undoes the change over
// the part of the picture where the board was seen (as mrcal's "implied rotation", for points at infinity).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/base/grid.h"
#include "calib/target/calibrate.h"

namespace trigpoint {

// Values on a grid of pixels, row by row.
struct ImageGrid {
  int cols = 0, rows = 0;
  std::vector<Eigen::Vector2d> pixels;
  Eigen::Vector2d At(int col, int row) const { return pixels[CellIndex(row, col, cols)]; }
};
ImageGrid MakeGrid(int width, int height, int cols = 41);

// Where the board was seen.
struct Coverage {
  int cols = 0, rows = 0;   // cells of about the same size, over the picture
  std::vector<int> points;  // in each cell, row by row
  double share = 0;         // of the cells with points
  double radius_share = 0;  // largest distance of a point from the middle / that of the picture's corners
  // Which of the parts "upper left", "top", "upper right", "left", "middle", "right", "lower left", "bottom", "lower
  // right" have points in less than half of their cells.
  std::vector<std::string> poor;
};
Coverage MeasureCoverage(const CalibrationInput& input, const Calibration& calibration, int camera, int cols = 12);
// Does the board cover this pixel: are there points in its cell, or on two opposite sides of it?
bool IsCovered(const Coverage& coverage, int width, int height, const Eigen::Vector2d& pixel);

struct ProjectionUncertainty {
  ImageGrid grid;
  std::vector<double> sigma_px;  // largest standard deviation in any direction; NaN where the pixel has no ray
  std::vector<bool> covered;
  double median_covered_px = 0, max_covered_px = 0, max_px = 0;
  double rms_covered_px = 0;     // root mean square of a pixel's shift, both axes together, over the covered part
  double no_ray_share = 0;       // part of the picture whose pixels have no ray: the model folds back there
  void Multiply(double factor);  // every sigma
};
ProjectionUncertainty MeasureUncertainty(const CalibratedCamera& camera, const Coverage& coverage);

struct CameraDifference {
  ImageGrid grid;
  std::vector<Eigen::Vector2d> shift_px;  // pixel in b less pixel in a, after the rotation; NaN without a ray
  std::vector<bool> covered;
  double rms_covered_px = 0, max_covered_px = 0, max_px = 0;
  double rotation_rad = 0;  // the rotation that was undone
};
CameraDifference CompareCameras(const Camera& a, const Camera& b, const Coverage& coverage);

// Two halves of the frames, each calibrated by itself.
struct CrossValidation {
  bool done = false;
  std::string reason;                        // why not
  std::vector<CameraDifference> difference;  // of each camera
  // Root mean square of the difference over the covered part / of what the stated sigmas predict for it.
  std::vector<double> ratio;
  std::vector<double> rms_own_px, rms_other_px;  // on the half it was made from, on the other one
};
CrossValidation CrossValidate(const CalibrationInput& input, const CalibrateOptions& options,
                              const Calibration& calibration, const std::vector<Coverage>& coverage,
                              ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
