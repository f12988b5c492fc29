#include <fmt/format.h>

#include "eval/truth.h"

namespace trigpoint {
namespace {

nlohmann::json Json(const std::optional<double>& value) { return value ? nlohmann::json(*value) : nlohmann::json(); }

std::string Metres(const std::optional<double>& value) { return value ? fmt::format("{:.3f}", *value) : "-"; }

}  // namespace

std::string Describe(const TruthEvaluation& e) {
  return fmt::format(
      "{} of {} expected stations answered; relative (rigid fit of the cameras near by) median {}, P90 {}, max {} m; "
      "cameras in world RMSE {} horizontal, {} vertical m; ATE {} m after a rigid, {} m after a similarity fit",
      e.expected.size() - e.missing.size(), e.expected.size(), Metres(e.relative_median_m), Metres(e.relative_p90_m),
      Metres(e.relative_max_m), Metres(e.camera_rmse_h_m), Metres(e.camera_rmse_v_m), Metres(e.ate_se3_m),
      Metres(e.ate_sim3_m));
}

nlohmann::json TruthJson(const TruthEvaluation& e) {
  nlohmann::json answers = nlohmann::json::array();
  for (const TruthError& a : e.answers) {
    answers.push_back({{"station", a.station},
                       {"panorama", a.panorama},
                       {"relative_m", a.relative_m},
                       {"relative_rot_deg", a.relative_rot_deg},
                       {"world_h_m", Json(a.world_h_m)},
                       {"world_v_m", Json(a.world_v_m)},
                       {"nees", Json(a.nees)}});
  }
  return {{"frames_truth", e.frames_truth},
          {"frames_out", e.frames_out},
          {"expected", e.expected},
          {"missing", e.missing},
          {"answers", answers},
          {"rel_median", Json(e.relative_median_m)},
          {"rel_p90", Json(e.relative_p90_m)},
          {"rel_max", Json(e.relative_max_m)},
          {"world_cam_rmse_h", Json(e.camera_rmse_h_m)},
          {"world_cam_rmse_v", Json(e.camera_rmse_v_m)},
          {"ate_se3", Json(e.ate_se3_m)},
          {"ate_sim3", Json(e.ate_sim3_m)},
          {"scale_error", Json(e.scale_error)},
          {"pano_anees_per_dof", Json(e.panorama_anees_per_dof)},
          {"world_cam_nees_per_dof", Json(e.camera_nees_per_dof)}};
}

}  // namespace trigpoint
