// Is a calibration good enough to be used, and if not, what to photograph next?
#pragma once

#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/target/uncertainty.h"

namespace trigpoint {

// Each limit has a value that warns and one that refuses.
struct CalibrationGates {
  int warn_views = 10, refuse_views = 5;
  double warn_coverage = 0.75, refuse_coverage = 0.35;
  double warn_tilt_deg = 20, refuse_tilt_deg = 8;
  double warn_focal_sigma_percent = 0.3, refuse_focal_sigma_percent = 2;
  double warn_uncertainty_px = 1, refuse_uncertainty_px = 10;
  double warn_rms_px = 0.8, refuse_rms_px = 3;
  double warn_pattern_px = 0.15, refuse_pattern_px = 1;
  double warn_board_percent = 0.3, refuse_board_percent = 1.5;
  double warn_halves_px = 1, refuse_halves_px = 10;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.warn_views, {"warn_views", "", 0, 1e6, "warn below this many usable pictures of a camera"});
    visit(self.refuse_views, {"refuse_views", "", 0, 1e6, "refuse below this many usable pictures of a camera"});
    visit(self.warn_coverage, {"warn_coverage", "", 0, 1, "warn if the board covers a smaller share of the picture"});
    visit(self.refuse_coverage,
          {"refuse_coverage", "", 0, 1, "refuse if the board covers a smaller share of the picture"});
    visit(self.warn_tilt_deg,
          {"warn_tilt_deg", "deg", 0, 90, "warn if fewer than three pictures are tilted this much"});
    visit(self.refuse_tilt_deg,
          {"refuse_tilt_deg", "deg", 0, 90, "refuse if fewer than three pictures are tilted this much"});
    visit(self.warn_focal_sigma_percent,
          {"warn_focal_sigma_percent", "%", 0, 100, "warn above this focal length sigma"});
    visit(self.refuse_focal_sigma_percent,
          {"refuse_focal_sigma_percent", "%", 0, 100, "refuse above this focal length sigma"});
    visit(self.warn_uncertainty_px,
          {"warn_uncertainty_px", "px", 0, 1e6, "warn above this projection sigma where the board was seen"});
    visit(self.refuse_uncertainty_px,
          {"refuse_uncertainty_px", "px", 0, 1e6, "refuse above this projection sigma where the board was seen"});
    visit(self.warn_rms_px, {"warn_rms_px", "px", 0, 1e6, "warn above this residual"});
    visit(self.refuse_rms_px, {"refuse_rms_px", "px", 0, 1e6, "refuse above this residual"});
    visit(self.warn_pattern_px, {"warn_pattern_px", "px", 0, 1e6, "warn above this systematic part of the residuals"});
    visit(self.refuse_pattern_px,
          {"refuse_pattern_px", "px", 0, 1e6, "refuse above this systematic part of the residuals"});
    visit(self.warn_board_percent,
          {"warn_board_percent", "%", 0, 100, "warn if the board's proportions differ by more from its description"});
    visit(self.refuse_board_percent, {"refuse_board_percent", "%", 0, 100,
                                      "refuse if the board's proportions differ by more from its description"});
    visit(self.warn_halves_px,
          {"warn_halves_px", "px", 0, 1e6, "warn if the cameras of two halves of the pictures differ by more"});
    visit(self.refuse_halves_px,
          {"refuse_halves_px", "px", 0, 1e6, "refuse if the cameras of two halves of the pictures differ by more"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

enum class FindingLevel { kNote, kWarning, kRefusal };
// "note", "warning", "refusal".
std::string_view FindingLevelName(FindingLevel level);

struct Finding {
  FindingLevel level = FindingLevel::kNote;
  std::string camera;  // empty: all
  std::string check;   // "coverage", "tilt", ...
  std::string reason;  // what was found and expected
  std::string advice;  // what to do or photograph next; may be empty
};

// Mean residual over parts of the picture and over the board, and how much of it is more than chance.
struct ResidualPattern {
  int cols = 0, rows = 0;
  std::vector<Eigen::Vector2d> mean_px;  // of each part, NaN: too few points
  std::vector<int> points;
  double systematic_px = 0;  // root mean square of the part that noise doesn't explain
};
ResidualPattern ImagePattern(const CalibrationInput& input, const Calibration& calibration, int camera, int cols = 8);

struct Quality {
  FindingLevel level = FindingLevel::kNote;  // the worst of all: warning: usable with care, refusal: not
  std::vector<Finding> findings;
  std::vector<Coverage> coverage;  // of each camera
  std::vector<ProjectionUncertainty> uncertainty;
  std::vector<ResidualPattern> pattern;
  CrossValidation halves;
  BoardShape proportions;          // stretch, shear, gap, freed for the test; sigma 0: not tested
  double board_systematic_px = 0;  // systematic part of the residuals by board point
};

// Where two halves of the pictures differ by much more than the covariances predict, the residuals are not independent
// noise: all covariances of `calibration` are multiplied by the square of that (sigma_factor).
Quality JudgeCalibration(const CalibrationInput& input, const CalibrateOptions& options, const CalibrationGates& gates,
                         ProgressSink& progress, const CancelToken& cancel, Calibration* calibration);

}  // namespace trigpoint
