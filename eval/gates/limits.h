// The limits of the `gates:` block of trigpoint.yaml. 0: that gate is not set.
#pragma once

#include <string>
#include <vector>

#include "calib/base/option.h"

namespace trigpoint {

struct EvaluateLimits {
  double max_median_m = 0, max_p90_m = 0, min_answered = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_median_m, {"max_median_m", "m", 0.0, 1e6, "median 3D error over answers"});
    visit(self.max_p90_m, {"max_p90_m", "m", 0.0, 1e6, "90th percentile of the 3D error over answers"});
    visit(self.min_answered, {"min_answered", "", 0.0, 1.0, "share of attempts that are answered"});
  }
};

struct SurveyLimits {
  double max_check_rmse_h_m = 0, max_check_rmse_v_m = 0, max_check_rmse_3d_m = 0;
  double min_check_points = 0, max_standardised_residual = 0, max_tag_sigma_m = 0, max_repeatability_m = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_check_rmse_h_m,
          {"max_check_rmse_h_m", "m", 0.0, 1e6, "horizontal RMSE at check points, their own sigma in quadrature"});
    visit(self.max_check_rmse_v_m,
          {"max_check_rmse_v_m", "m", 0.0, 1e6, "vertical RMSE at check points, their own sigma in quadrature"});
    visit(self.max_check_rmse_3d_m,
          {"max_check_rmse_3d_m", "m", 0.0, 1e6, "RMSE in space at check points, their own sigma in quadrature"});
    visit(self.min_check_points, {"min_check_points", "", 0.0, 1e6, "count of check points that the map reached"});
    visit(self.max_standardised_residual, {"max_standardised_residual", "", 0.0, 1e6,
                                           "largest residual of a control point, check point or distance, in sigmas"});
    visit(self.max_tag_sigma_m, {"max_tag_sigma_m", "m", 0.0, 1e6, "largest 1 sigma of a tag's centre, any axis"});
    visit(self.max_repeatability_m,
          {"max_repeatability_m", "m", 0.0, 1e6, "RMS of tags between maps of all runs but one and the map of all"});
  }
};

struct LocalizeLimits {
  double min_answered = 0, max_sigma_m = 0, max_nees_per_dof = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.min_answered, {"min_answered", "", 0.0, 1.0, "share of the references that a run localizes"});
    visit(self.max_sigma_m, {"max_sigma_m", "m", 0.0, 1e6, "largest 1 sigma of a localized panorama, any axis"});
    visit(self.max_nees_per_dof,
          {"max_nees_per_dof", "", 0.0, 1e6, "consistency: squared error in its stated sigmas, per degree of freedom"});
  }
};

struct TrajectoryLimits {
  double max_ate_m = 0, max_rpe_m = 0, min_coverage = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_ate_m, {"max_ate_m", "m", 0.0, 1e6, "absolute trajectory error (RMSE)"});
    visit(self.max_rpe_m, {"max_rpe_m", "m", 0.0, 1e6, "relative error over pieces of the path (RMSE)"});
    visit(self.min_coverage, {"min_coverage", "", 0.0, 1.0, "share of the reference's images that have an estimate"});
  }
};

struct StitchLimits {
  double max_rms_px = 0, max_closure_deg = 0, min_coverage = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_rms_px, {"max_rms_px", "px", 0.0, 1e6, "residuals of the rig, rms"});
    visit(self.max_closure_deg, {"max_closure_deg", "deg", 0.0, 360.0, "closure of a full turn, absolute"});
    visit(self.min_coverage, {"min_coverage", "", 0.0, 1.0, "covered share of the sphere"});
  }
};

struct CalibrationLimits {
  double max_rms_px = 0, max_focal_sigma_percent = 0;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_rms_px, {"max_rms_px", "px", 0.0, 1e6, "residuals of a camera, rms"});
    visit(self.max_focal_sigma_percent,
          {"max_focal_sigma_percent", "%", 0.0, 100.0, "1 sigma of the focal length, in percent of it"});
  }
};

struct GateLimits {
  double confidence = 0.95;
  EvaluateLimits evaluate;
  SurveyLimits survey;
  LocalizeLimits localize;
  TrajectoryLimits estimates;
  StitchLimits stitch;
  CalibrationLimits calibration;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.confidence, {"confidence", "", 0.5, 0.999, "confidence of the intervals that the gates are decided by"});
    visit(self.evaluate, {"evaluate", "", 0, 0, "errors of localized panoramas"});
    visit(self.survey, {"survey", "", 0, 0, "the tag map"});
    visit(self.localize, {"localize", "", 0, 0, "localized panoramas of each run"});
    visit(self.estimates, {"estimates", "", 0, 0, "cameras and other systems' trajectories against the reference"});
    visit(self.stitch, {"stitch", "", 0, 0, "each photo set"});
    visit(self.calibration, {"calibration", "", 0, 0, "each calibration"});
  }
};

// One limit that is set.
struct GateLimit {
  std::string section, name, unit, meaning;
  double limit = 0;
  bool upper = true;  // the value must be at most the limit; else at least
  std::string Gate() const { return section + "." + name; }
};
std::vector<GateLimit> SetLimits(const GateLimits& limits);

// What the report judges by where a project sets no limits: half of the panoramas found, half a metre in the median,
// sigmas that hold within a factor of 1.4, no residual of the survey beyond 4 sigma, rings of photos that close, boards
// to half a pixel.
GateLimits DefaultLimits();

// Every gate there is, set or not.
std::vector<GateLimit> AllGates();

}  // namespace trigpoint
