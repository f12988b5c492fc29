// Cameras as they were calibrated, and runs held against other programs.
#include <fmt/format.h>

#include <algorithm>

#include "eval/report/chapters.h"

namespace trigpoint {
namespace {

// "1234.5 ± 0.3" of a parameter; empty if the camera has none of this name.
TableCell ParameterCell(const nlohmann::json& camera, const char* name, int decimals) {
  const auto value = At(camera, {"parameters", name}), sigma = At(camera, {"sigma", name});
  if (!value) return {};
  return {fmt::format("{:.{}f}", *value, decimals) + (sigma ? fmt::format(" ± {:.{}f}", *sigma, decimals + 1) : ""),
          value};
}

Table CrosscheckedPanoramas(const ChapterContext& c) {
  Table table{
      "crosscheck_panoramas",
      "COLMAP looked for every panorama over the whole run, whether Trigpoint localized it or not. Contradicts: the "
      "two answers differ by more than both errors explain (99.9 % of chi-square, 3 degrees of freedom). Found by "
      "them alone: COLMAP alone found it, perhaps Trigpoint refused it wrongly.",
      {{"run"},
       {"panorama"},
       {"verdict"},
       {"ours"},
       {"their views", true},
       {"their points", true},
       {"apart (" + c.unit.name + ")", true},
       {"chi-square", true}},
      {}};
  for (const ResultRecord& s : c.input.stages) {
    const nlohmann::json& metrics = ObjectAt(s.manifest, "metrics");
    const auto panoramas = metrics.find("panoramas");
    if (s.stage != "crosscheck" || panoramas == metrics.end() || !panoramas->is_array()) continue;
    for (const nlohmann::json& p : *panoramas) {
      const std::string verdict = TextAt(p, "verdict");
      const bool doubtful = verdict == "contradicts" || verdict == "found by them alone";
      table.rows.push_back({{s.name},
                            {TextAt(p, "panorama")},
                            {verdict, {}, doubtful ? Tone::kWarning : Tone::kPlain},
                            {TextAt(p, "ours")},
                            NumberCell(At(p, {"views"}), 0),
                            NumberCell(At(p, {"points"}), 0),
                            c.LengthCell(At(p, {"length_m"})),
                            NumberCell(At(p, {"chi2_3dof"}), 1)});
    }
  }
  return table;
}

}  // namespace

void AddCalibrations(const ChapterContext& c, std::vector<Block>* blocks) {
  Table table{"calibrations",
              "Calibrated cameras: what results/calibrate holds. Residual: root mean square over the points used; "
              "1 sigma behind each parameter. Refused: too poor to be used, and written with a name that no run reads.",
              {{"calibration"},
               {"camera"},
               {"model"},
               {"width (px)", true},
               {"height (px)", true},
               {"views", true},
               {"residual (px)", true},
               {"fx (px)", true},
               {"fy (px)", true},
               {"cx (px)", true},
               {"cy (px)", true},
               {"status"}},
              {}};
  for (const ResultRecord& s : c.input.stages) {
    const nlohmann::json& metrics = ObjectAt(s.manifest, "metrics");
    const auto cameras = metrics.find("cameras");
    if (s.stage != "calibrate" || cameras == metrics.end() || !cameras->is_array()) continue;
    for (const nlohmann::json& camera : *cameras) {
      const bool refused = FlagAt(metrics, "refused");
      table.rows.push_back({{s.name},
                            {TextAt(camera, "name")},
                            {TextAt(camera, "model")},
                            NumberCell(At(camera, {"width"}), 0),
                            NumberCell(At(camera, {"height"}), 0),
                            NumberCell(At(camera, {"views_used"}), 0),
                            NumberCell(At(camera, {"rms_px"}), 3),
                            ParameterCell(camera, "fx", 2),
                            ParameterCell(camera, "fy", 2),
                            ParameterCell(camera, "cx", 2),
                            ParameterCell(camera, "cy", 2),
                            {refused ? "refused" : s.state, {}, refused ? Tone::kBad : Tone::kPlain}});
    }
  }
  if (table.rows.empty()) return;
  blocks->push_back(Heading{2, "Calibration", "calibration"});
  blocks->push_back(table);
}

void AddCrosschecks(const ChapterContext& c, std::vector<Block>* blocks) {
  const std::string u = " (" + c.unit.name + ")";
  Table table{"crosschecks",
              "Camera positions of each run against those of another program, after the named alignment; normalised: "
              "median difference in our own sigmas, about 1 where these are right.",
              {{"run"},
               {"against"},
               {"images", true},
               {"alignment"},
               {"rms" + u, true},
               {"largest" + u, true},
               {"rotation, median (deg)", true},
               {"normalised", true},
               {"status"}},
              {}};
  for (const ResultRecord& s : c.input.stages) {
    if (s.stage != "crosscheck") continue;
    for (const auto& [system, m] : ObjectAt(ObjectAt(s.manifest, "metrics"), "systems").items()) {
      const std::string reason = TextAt(m, "reason"),
                        status = TextAt(m, "status") + (reason.empty() ? "" : ": " + reason);
      const size_t before = table.rows.size();
      for (const auto& [alignment, figures] : m.items()) {
        if (!At(figures, {"rmse_m"})) continue;
        table.rows.push_back({{s.name},
                              {system},
                              NumberCell(At(m, {"registered"}), 0),
                              {alignment},
                              c.LengthCell(At(figures, {"rmse_m"})),
                              c.LengthCell(At(figures, {"max_m"})),
                              NumberCell(At(figures, {"rotation_median_deg"}), 3),
                              NumberCell(At(figures, {"normalised_median"}), 2),
                              {status}});
      }
      if (table.rows.size() == before) {
        table.rows.push_back({{s.name}, {system}, NumberCell(At(m, {"registered"}), 0), {}, {}, {}, {}, {}, {status}});
      }
    }
  }
  if (table.rows.empty()) return;
  blocks->push_back(Heading{2, "Cross-check", "crosscheck"});
  blocks->push_back(table);
  if (Table panoramas = CrosscheckedPanoramas(c); !panoramas.rows.empty()) blocks->push_back(std::move(panoramas));
}

}  // namespace trigpoint
