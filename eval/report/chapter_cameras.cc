// Cameras, and trajectories of other systems, against the reference poses.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "eval/report/chapters.h"
#include "eval/report/error_run.h"

namespace trigpoint {
namespace {

constexpr size_t kMostCharts = 8;

// Share of the errors' components within two sigmas of them, in percent; unset for an estimate without sigmas of its
// own: those of the reference alone are no claim about its errors.
std::optional<double> WithinTwoSigmas(const TrajectoryScore& score) {
  int within = 0, all = 0;
  for (const ErrorAlong& e : score.images) {
    if (!e.error_m || !e.sigma_m || !e.stated) continue;
    for (int k = 0; k < 3; ++k) within += std::abs((*e.error_m)[k]) <= 2 * (*e.sigma_m)[k];
    all += 3;
  }
  return all > 0 ? std::optional<double>(100.0 * within / all) : std::nullopt;
}

Table ScoreTable(const ChapterContext& c) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{
      "cameras",
      "ATE: root mean square distance in the site's frame, with its 95 % interval by blocks in time; the lower end is "
      "without the reference's uncertainty, which the estimate may share; fitted: after a rigid fit; RPE: over "
      "consecutive pieces of the path. "
      "Within 2 sigma: components of the errors, of estimate and reference together; 95 % where stated sigmas are "
      "right.",
      {{"system"},
       {"run"},
       {"images", true},
       {"with an estimate", true},
       {"ATE" + u, true},
       {"from" + u, true},
       {"to" + u, true},
       {"fitted" + u, true},
       {"rotation (deg)", true},
       {"RPE" + u, true, "the path has no piece of this length"},
       {"RPE (deg)", true, "the path has no piece of this length"},
       {"RPE length" + u, true},
       {"pieces", true},
       {"within 2 sigma (%)", true, "the system states no sigmas"}},
      {}};
  for (const TrajectoryScore& score : c.data.trajectories) {
    const nlohmann::json& s = score.summary;
    const IntervalEnds rmse = EndsAt(s, "own_rmse_interval_m").value_or(IntervalEnds());
    table.rows.push_back({{TextAt(s, "system")},
                          {TextAt(s, "run")},
                          NumberCell(At(s, {"attempts"}), 0),
                          NumberCell(At(s, {"answers"}), 0),
                          c.LengthCell(At(s, {"rmse_m"})),
                          c.LengthCell(rmse.low),
                          c.LengthCell(rmse.high),
                          c.LengthCell(At(s, {"aligned_rmse_m"})),
                          NumberCell(At(s, {"rmse_rot_deg"}), 3),
                          c.LengthCell(At(s, {"rpe", "rmse_m"})),
                          NumberCell(At(s, {"rpe", "rmse_deg"}), 3),
                          c.LengthCell(At(s, {"rpe", "length_m"}), 1),
                          NumberCell(At(s, {"rpe", "pieces"}), 0),
                          NumberCell(WithinTwoSigmas(score), 1)});
  }
  return table;
}

}  // namespace

void AddCameras(const ChapterContext& c, std::vector<Block>* blocks) {
  if (c.data.trajectories.empty()) return;
  blocks->push_back(Heading{2, "Cameras", "cameras"});
  blocks->push_back(Paragraph{
      "The estimated pose of every image against the reference trajectory, which the tag map gives where tags are "
      "seen. "
      "The system trigpoint is this program's own result. Both sides use the same images where a run is part of the "
      "survey, too."});
  blocks->push_back(ScoreTable(c));
  size_t charts = 0;
  const auto add = [&](const TrajectoryScore& score) {
    const bool any = std::any_of(score.images.begin(), score.images.end(),
                                 [](const ErrorAlong& e) { return e.error_m.has_value(); });
    if (!any || charts == kMostCharts) return;
    blocks->push_back(Figure{fmt::format("camera_errors_{}", ++charts),
                             "Camera errors of " + TextAt(score.summary, "system") + " on " +
                                 TextAt(score.summary, "run") +
                                 ": estimate minus reference along the run. Band: two sigmas of that difference, the "
                                 "reference's and, where stated, the estimate's together.",
                             ErrorRunChart(score.images, c.unit.name, c.unit.metres)});
  };
  const auto is_variant = [](const TrajectoryScore& score) {
    return TextAt(score.summary, "system").find('@') != std::string::npos;
  };
  bool variants = false;
  for (const TrajectoryScore& score : c.data.trajectories) {
    if (!is_variant(score)) add(score);
    variants = variants || is_variant(score);
  }
  if (!variants) return;
  blocks->push_back(FoldBegin{"Errors along the runs of variants", false});
  for (const TrajectoryScore& score : c.data.trajectories) {
    if (is_variant(score)) add(score);
  }
  blocks->push_back(FoldEnd{});
}

}  // namespace trigpoint
