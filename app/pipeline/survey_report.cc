#include "app/pipeline/survey_report.h"

#include <fmt/format.h>

#include <cmath>

namespace trigpoint {
namespace {

using nlohmann::json;

constexpr int kConformantChecks = 30;  // ASPRS Positional Accuracy Standards, edition 2: least number of check points

std::string_view RoleName(PointRole role) {
  switch (role) {
    case PointRole::kControl: return "control";
    case PointRole::kCheck: return "check";
    case PointRole::kGeotag: return "geotag";
  }
  return "";
}

json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

json SurveySummary(const SurveyJob& job, const SurveyResult& result) {
  json tags = json::array(), points = json::array(), runs = json::array();
  for (const TagEstimate& t : result.tags) {
    tags.push_back({{"tag_id", t.tag_id}, {"status", t.status}, {"reason", t.reason}, {"images", t.images}});
  }
  for (const PointAgreement& p : result.points) {
    points.push_back({{"name", p.name},
                      {"role", RoleName(p.role)},
                      {"tag_id", p.tag_id},
                      {"map_minus_stated_m", Vector(p.error_m)},
                      {"sigma_h_m", p.sigma_h_m},
                      {"sigma_v_m", p.sigma_v_m},
                      {"chi2_3dof", p.chi2}});
  }
  for (const RunAgreement& r : result.runs) {
    runs.push_back({{"name", r.name},
                    {"frames", r.frames},
                    {"sights", r.sights},
                    {"rejected", r.rejected},
                    {"rms_px", r.rms_px},
                    {"scale", r.scale},
                    {"scale_sigma", r.scale_sigma},
                    {"corner_factor", r.corner_factor}});
  }
  json check = {{"n", result.check.n}, {"note", job.check_note}};
  if (result.check.n > 0) {
    check["rmse_h_m"] = result.check.rmse_h_m;
    check["rmse_v_m"] = result.check.rmse_v_m;
    check["rmse_3d_m"] = result.check.rmse_3d_m;
    check["conformant"] = result.check.n >= kConformantChecks;
  }
  return {{"schema", "trigpoint survey 1"},
          {"datum", result.datum},
          {"frame", result.in_world ? "enu" : "map"},
          {"tags", tags},
          {"points", points},
          {"check", check},
          {"runs", runs},
          {"warnings", result.warnings}};
}

std::string FormatSurvey(const SurveyJob& job, const SurveyResult& result, const DisplayUnit& unit) {
  const auto length = [&](double metres) { return fmt::format("{:.3f}", metres / unit.metres); };
  std::string text = fmt::format("Datum: {} ({})\n\n", result.datum,
                                 result.in_world ? "site ENU" : "a frame of its own, not on the Earth");
  text += fmt::format("| tag | role | images | runs | sigma x, y, z ({}, 1 sigma) | rms px | status |\n", unit.name);
  text += "|---|---|---|---|---|---|---|\n";
  for (const TagEstimate& t : result.tags) {
    std::string sigma;
    for (int i = 3; t.HasPose() && i < 6; ++i) {
      sigma += (i > 3 ? ", " : "") + length(std::sqrt(std::max(0.0, t.covariance(i, i))));
    }
    text += fmt::format("| {} | {} | {} | {} | {} | {:.2f} | {} |\n", t.tag_id, t.role, t.images, t.runs, sigma,
                        t.rms_px, t.status);
  }
  if (result.check.n > 0) {
    text += fmt::format(
        "\nCheck points (took no part): n = {}, RMSE_H {} {}, RMSE_V {} {}, RMSE_3D {} {}{}\n", result.check.n,
        length(result.check.rmse_h_m), unit.name, length(result.check.rmse_v_m), unit.name,
        length(result.check.rmse_3d_m), unit.name,
        result.check.n < kConformantChecks
            ? fmt::format("; not conformant, n = {} (ASPRS edition 2 asks for {})", result.check.n, kConformantChecks)
            : "");
  }
  if (!job.check_note.empty()) text += "\n" + job.check_note + "\n";
  return text;
}

}  // namespace trigpoint
