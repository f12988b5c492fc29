#include "eval/survey/summary.h"

#include <string>

namespace trigpoint {
namespace {

using nlohmann::json;

json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

json CheckJson(const CheckSummary& check, const SurveyFindings& findings) {
  json j = {{"n", check.n}, {"note", findings.check_note}};
  if (check.n == 0) return j;
  const ReportedAccuracy a = ReportedOf(check);
  j.update({{"rmse_h_m", a.h},
            {"rmse_v_m", a.v},
            {"rmse_3d_m", a.d},
            {"differences_rmse_h_m", check.rmse_h_m},
            {"differences_rmse_v_m", check.rmse_v_m},
            {"differences_rmse_3d_m", check.rmse_3d_m},
            {"check_points_sigma_h_m", check.stated_h_m},
            {"check_points_sigma_v_m", check.stated_v_m},
            {"standard", "ASPRS Positional Accuracy Standards, edition 2"},
            {"conformant", check.n >= kConformantChecks}});
  if (findings.nssda) {
    j["nssda_horizontal_95_m"] = kNssdaHorizontal * a.h;
    j["nssda_vertical_95_m"] = kNssdaVertical * a.v;
  }
  return j;
}

json RepeatabilityJson(const Repeatability& r) {
  return {{"rms_m", r.rms_m}, {"maps", r.maps}, {"differences", r.differences}};
}

json PointJson(const PointAgreement& p) {
  json point = {{"name", p.name},
                {"role", RoleName(p.role)},
                {"tag_id", p.tag_id},
                {"used", p.used},
                {"excluded", p.excluded},
                {"checked", p.checked},
                {"map_minus_stated_m", Vector(p.error_m)},
                {"sigma_h_m", p.sigma_h_m},
                {"sigma_v_m", p.sigma_v_m},
                {"chi2_3dof", p.chi2}};
  point["status"] = StatusOf(p);
  point["stated_m"] = Vector(p.stated_m);
  point["covariance_h_m2"] = {p.covariance_m2(0, 0), p.covariance_m2(0, 1), p.covariance_m2(1, 1)};
  if (p.left_out_m) {
    point["left_out_m"] = Vector(*p.left_out_m);
    point["left_out_sigma_m"] = Vector(p.left_out_sigma_m);
  }
  return point;
}

json ControlJson(const ControlSystems& control) {
  json differences = json::array();
  for (const EpochDifference& d : control.epoch_differences) {
    differences.push_back({{"point", d.point},
                           {"earlier", d.earlier},
                           {"used", d.used},
                           {"used_minus_earlier_m", Vector(d.difference_m)},
                           {"sigma_m", Vector(d.sigma_m)},
                           {"chi2_3dof", d.chi2},
                           {"moved", d.Moved()}});
  }
  return {{"crs", control.crs},
          {"heights", control.heights},
          {"epochs", control.epochs},
          {"epoch_differences", differences}};
}

json RunJson(const RunAgreement& r, const SurveyFindings& findings) {
  json factors = json::array();
  for (double f : r.odometry_factor) factors.push_back(f);
  json run = {{"name", r.name},
              {"stills", r.stills},
              {"frames", r.frames},
              {"sights", r.sights},
              {"rejected", r.rejected},
              {"rms_px", r.rms_px},
              {"odometry_jumps", r.jumps_ns.size()},
              {"scale", r.scale},
              {"scale_sigma", r.scale_sigma},
              {"heading_drift_deg_m", r.heading_drift_deg_m},
              {"heading_drift_sigma_deg_m", r.heading_drift_sigma_deg_m},
              {"corner_shift_px", r.corner_shift_px},
              {"corner_shift_sigma_px", r.corner_shift_sigma_px},
              {"corner_factor", r.corner_factor},
              {"odometry_factors_rx_ry_rz_x_y_z", factors}};
  if (const auto date = findings.sessions.find(r.name); date != findings.sessions.end()) run["date"] = date->second;
  if (const auto without = findings.repeats.without.find(r.name);
      without != findings.repeats.without.end() && without->second.differences > 0) {
    run["repeatability_m"] = without->second.rms_m;
  }
  if (r.camera) run["self_calibrated"] = {{"params", r.camera->params()}, {"sigma", r.camera_sigma}};
  return run;
}

// What limits the tags, and what would help most.
json BudgetJson(const SurveyResult& result) {
  json tags = json::array();
  for (const TagBudget& b : result.budgets) {
    json tag = {{"tag_id", b.tag_id}, {"sigma_3d_m", b.total_m}, {"limited_by", BudgetName(b.LimitedBy())}};
    for (size_t s = 0; s < kBudgetSources; ++s) {
      tag[std::string(BudgetName(static_cast<BudgetSource>(s))) + "_m"] = b.sigma_m[s];
    }
    tags.push_back(tag);
  }
  json budget = {{"tags", tags}};
  if (const auto& next = result.next_point) {
    budget["next_point"] = {{"tag_id", next->tag_id},
                            {"sigma_h_m", next->sigma_h_m},
                            {"sigma_v_m", next->sigma_v_m},
                            {"rms_now_m", next->rms_now_m},
                            {"rms_then_m", next->rms_then_m},
                            {"worst_now_m", next->worst_now_m},
                            {"worst_then_m", next->worst_then_m}};
  }
  return budget;
}

json TagJson(const TagEstimate& t, const SurveyResult& result) {
  json tag = {{"tag_id", t.tag_id}, {"status", t.status},     {"reason", t.reason},
              {"images", t.images}, {"rejected", t.rejected}, {"role", t.role}};
  for (const TagShape& s : result.shapes) {
    if (s.tag_id != t.tag_id) continue;
    tag["size_ratio"] = s.size_ratio;
    tag["size_ratio_sigma"] = s.size_sigma;
    tag["aspect"] = s.aspect;
    tag["aspect_sigma"] = s.aspect_sigma;
    tag["twist_m"] = s.twist_m;
    tag["twist_sigma_m"] = s.twist_sigma_m;
  }
  return tag;
}

json DistancesJson(const SurveyResult& result) {
  json distances = json::array();
  for (const DistanceAgreement& d : result.distances) {
    distances.push_back({{"from", d.stated.from},
                         {"to", d.stated.to},
                         {"role", d.stated.check ? "check" : "control"},
                         {"excluded", d.excluded},
                         {"measured_m", d.stated.distance_m},
                         {"map_m", d.map_m},
                         {"sigma_m", d.sigma_m}});
  }
  return distances;
}

json ShiftsJson(const SurveyResult& result) {
  json shifts = json::array();
  for (const DatumShift& s : result.shifts) {
    shifts.push_back({{"of", s.of},
                      {"n", s.n},
                      {"stated_minus_map_m", Vector(s.stated_minus_map_m)},
                      {"sigma_m", Vector(s.sigma_m)}});
  }
  return shifts;
}

json FitJson(const FitToPoints& fit) {
  json j = {{"n", fit.n}, {"median_m", fit.median_m}, {"rmse_m", fit.rmse_m}, {"max_m", fit.max_m}};
  for (const auto& [name, distance] : fit.worst) j["beyond_three_medians"][name] = distance;
  return j;
}

json StationJson(const StationOffset& o) {
  json station = {{"station", o.station},
                  {"panorama", o.panorama},
                  {"tag_id", o.tag_id},
                  {"reason", o.reason},
                  {"stated_m", Vector(o.stated_m)}};
  if (o.offset_m) {
    station.update({{"estimated_m", Vector(*o.offset_m)},
                    {"sigma_m", Vector(o.covariance.diagonal().cwiseSqrt())},
                    {"combined_m", Vector(o.combined_m)},
                    {"chi2_3dof", o.chi2},
                    {"tags", o.tags},
                    {"own_tag", o.own_tag},
                    {"rejected", o.rejected}});
  }
  return station;
}

json AgainstJson(const SurveyFindings& findings) {
  json moved = json::array();
  for (const TagChange& t : findings.epochs->tags) {
    moved.push_back({{"tag_id", t.tag_id},
                     {"moved", t.moved},
                     {"shift_m", Vector(t.shift_m)},
                     {"turn_deg", t.turn_deg},
                     {"chi2_6dof", t.chi2}});
  }
  return {{"survey", findings.against},
          {"aligned", findings.epochs->aligned},
          {"problem", findings.epochs->problem},
          {"tags", moved}};
}

}  // namespace

json SurveySummary(const SurveyResult& result, const SurveyFindings& findings) {
  json tags = json::array(), points = json::array(), runs = json::array(), plane = json::array();
  json warnings = json::array();
  for (const TagEstimate& t : result.tags) tags.push_back(TagJson(t, result));
  for (const PointAgreement& p : result.points) points.push_back(PointJson(p));
  for (const RunAgreement& r : result.runs) runs.push_back(RunJson(r, findings));
  for (const PlaneAgreement& p : result.plane) {
    plane.push_back({{"tag_id", p.tag_id}, {"height_m", p.height_m}, {"sigma_m", p.sigma_m}});
  }
  for (const MapWarning& w : result.warnings) warnings.push_back(w.text);
  json summary = {{"schema", "trigpoint survey 1"},
                  {"datum", result.datum},
                  {"gauge", result.gauge},
                  {"frame", findings.frame},
                  {"tags", tags},
                  {"points", points},
                  {"check", CheckJson(result.check, findings)},
                  {"distances", DistancesJson(result)},
                  {"plane", plane},
                  {"datum_shifts", ShiftsJson(result)},
                  {"runs", runs},
                  {"photo_sets", findings.photo_sets},
                  {"iterations", result.iterations},
                  {"warnings", warnings}};
  summary["control"] = ControlJson(findings.control);
  if (result.fit) summary["rigid_fit_to_points"] = FitJson(*result.fit);
  for (const StationOffset& o : findings.stations) summary["stations"].push_back(StationJson(o));
  if (!result.budgets.empty()) summary["budget"] = BudgetJson(result);
  if (findings.repeats.repeatability) summary["repeatability"] = RepeatabilityJson(*findings.repeats.repeatability);
  if (findings.repeats.reproducibility)
    summary["reproducibility_between_days"] = RepeatabilityJson(*findings.repeats.reproducibility);
  if (findings.epochs) summary["against"] = AgainstJson(findings);
  return summary;
}

}  // namespace trigpoint
