#include <fmt/format.h>

#include "eval/text/json_values.h"
#include "eval/text/number_text.h"
#include "eval/truth/truth.h"

namespace trigpoint {
namespace {

std::string Metres(const std::optional<double>& value) { return NumberText(value, 3, "-"); }

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
                       {"world_h_m", OrNull(a.world_h_m)},
                       {"world_v_m", OrNull(a.world_v_m)},
                       {"nees", OrNull(a.nees)}});
  }
  return {{"frames_truth", e.frames_truth},
          {"frames_out", e.frames_out},
          {"expected", e.expected},
          {"missing", e.missing},
          {"answers", answers},
          {"rel_median", OrNull(e.relative_median_m)},
          {"rel_p90", OrNull(e.relative_p90_m)},
          {"rel_max", OrNull(e.relative_max_m)},
          {"world_cam_rmse_h", OrNull(e.camera_rmse_h_m)},
          {"world_cam_rmse_v", OrNull(e.camera_rmse_v_m)},
          {"ate_se3", OrNull(e.ate_se3_m)},
          {"ate_sim3", OrNull(e.ate_sim3_m)},
          {"scale_error", OrNull(e.scale_error)},
          {"pano_anees_per_dof", OrNull(e.panorama_anees_per_dof)},
          {"world_cam_nees_per_dof", OrNull(e.camera_nees_per_dof)}};
}

}  // namespace trigpoint
