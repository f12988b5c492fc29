// A localize result against known poses: for tests and benchmarks on data with truth.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "eval/errors/results.h"

namespace trigpoint {

// True poses in world.
struct Truth {
  std::vector<TimedPose> cameras;    // world_from_cam
  std::map<int, Rigid3d> panoramas;  // world_from_pano by station number
};

// <dir>/runs/<run>_cameras.tum and <dir>/panoramas_<run>.tum, or <dir>/panoramas.tum without the former. The first
// column of a panorama file is the station's number. Throws InputError.
Truth ReadTruth(const std::filesystem::path& dir, const std::string& run);

struct TruthOptions {
  double fit_radius_m = 15;       // the cameras within it of the station (true positions) fit the run's frame
  double expected_radius_m = 12;  // a station this near to the run's true path is expected to be answered
  double max_time_difference_s = 0.01;
};

struct TruthError {
  int station = 0;
  std::string panorama;
  // After the rigid, unscaled fit of the run's own cameras near the station, their rotations included: drift elsewhere
  // does not count.
  double relative_m = 0;
  double relative_rot_deg = 0;
  // World as it is; unset without a world position.
  std::optional<double> world_h_m, world_v_m;
  std::optional<double> nees;  // of the world position, three degrees of freedom, axes taken as independent
};

struct TruthEvaluation {
  int frames_truth = 0, frames_out = 0;
  std::vector<int> expected, missing;  // station numbers, ascending; missing: expected but not answered
  std::vector<TruthError> answers;     // ascending station
  std::optional<double> relative_median_m, relative_p90_m, relative_max_m;  // over answers
  std::optional<double> camera_rmse_h_m, camera_rmse_v_m;                   // world, no alignment
  std::optional<double> ate_se3_m, ate_sim3_m, scale_error;                 // odom frame
  std::optional<double> panorama_anees_per_dof;
  // Cameras share one global fit, so that their errors are correlated: a hint, not a test.
  std::optional<double> camera_nees_per_dof;
};

// A station's number is the digits of its name; an answer for a station
// without truth throws InputError. O(n log n).
TruthEvaluation EvaluateAgainstTruth(const LocalizeResult& result, const Truth& truth,
                                     const TruthOptions& options = {});

// One sentence, metres; and the same as JSON, every answer with its errors.
std::string Describe(const TruthEvaluation& evaluation);
nlohmann::json TruthJson(const TruthEvaluation& evaluation);

}  // namespace trigpoint
