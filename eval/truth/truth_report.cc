#include <fmt/format.h>

#include "eval/truth/truth.h"

namespace trigpoint {
namespace {

nlohmann::json Number(const std::optional<double>& value) { return value ? nlohmann::json(*value) : nlohmann::json(); }

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
                       {"world_h_m", Number(a.world_h_m)},
                       {"world_v_m", Number(a.world_v_m)},
                       {"nees", Number(a.nees)}});
  }
  return {{"frames_truth", e.frames_truth},
          {"frames_out", e.frames_out},
          {"expected", e.expected},
          {"missing", e.missing},
          {"answers", answers},
          {"rel_median", Number(e.relative_median_m)},
          {"rel_p90", Number(e.relative_p90_m)},
          {"rel_max", Number(e.relative_max_m)},
          {"world_cam_rmse_h", Number(e.camera_rmse_h_m)},
          {"world_cam_rmse_v", Number(e.camera_rmse_v_m)},
          {"ate_se3", Number(e.ate_se3_m)},
          {"ate_sim3", Number(e.ate_sim3_m)},
          {"scale_error", Number(e.scale_error)},
          {"pano_anees_per_dof", Number(e.panorama_anees_per_dof)},
          {"world_cam_nees_per_dof", Number(e.camera_nees_per_dof)}};
}

}  // namespace trigpoint
