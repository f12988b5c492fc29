#include <fmt/format.h>

#include <cmath>

#include "calib/geo/geodetic.h"
#include "datasets/io/csv.h"
#include "datasets/solution/covariance_tables.h"
#include "eval/text/json_values.h"
#include "eval/text/markdown.h"
#include "eval/text/number_text.h"
#include "eval/trajectory/estimates.h"

namespace trigpoint {
namespace {

nlohmann::json Json(const ErrorStatistics& s) {
  return {{"median_m", OrNull(s.median)},
          {"p90_m", OrNull(s.p90)},
          {"max_m", OrNull(s.max)},
          {"median_attempts_m", OrNull(s.median_attempts)},
          {"p90_attempts_m", OrNull(s.p90_attempts)}};
}

}  // namespace

void WriteEstimates(const std::vector<EstimateReport>& reports, const std::filesystem::path& file) {
  CsvWriter csv({"system",
                 "run",
                 "timestamp",
                 "image",
                 "status",
                 "reason",
                 "reference_status",
                 "error_3d_m",
                 "error_h_m",
                 "error_v_m",
                 "de_m",
                 "dn_m",
                 "du_m",
                 "error_rot_deg",
                 "reference_sigma_e_m",
                 "reference_sigma_n_m",
                 "reference_sigma_u_m",
                 "sigma_e_m",
                 "sigma_n_m",
                 "sigma_u_m"},
                {"trigpoint estimates 1; unit=m; axes=enu; sigma=1; d: estimate minus reference; reference_sigma: of "
                 "the reference, sigma: of the estimate as it states it"});
  for (const EstimateReport& report : reports) {
    for (const EstimateRow& row : report.rows) {
      csv.Text(report.system).Text(report.run).Stamp(row.stamp_ns).Text(row.image).Text(row.status).Text(row.reason);
      csv.Text(row.reference_status);
      if (row.error_m) {
        const Eigen::Vector3d& e = *row.error_m;
        csv.Number(e.norm(), 9).Number(e.head<2>().norm(), 9).Number(std::abs(e.z()), 9);
        csv.Number(e.x(), 9).Number(e.y(), 9).Number(e.z(), 9).Number(*row.error_rot_deg, 7);
      } else {
        csv.Empty(7);
      }
      if (row.status == "no_reference") {
        csv.Empty(3);
      } else {
        for (int i = 0; i < 3; ++i) csv.Number(row.reference_sigma_m[i], 6);
      }
      for (int i = 0; i < 3; ++i) row.estimate_sigma_m ? csv.Number((*row.estimate_sigma_m)[i], 6) : csv.Empty();
      csv.EndRow();
    }
  }
  csv.Save(file);
}

std::string FormatEstimates(const std::vector<EstimateReport>& reports, const std::string& unit,
                            double metres_per_unit) {
  const auto length = [&](const std::optional<double>& metres) { return NumberText(metres, 3, "-", metres_per_unit); };
  std::vector<std::vector<std::string>> lines{{"system", "run", "answers", "attempts", "rmse", "95 % interval", "RPE",
                                               "median", "P90", "P90 of attempts", "horizontal median",
                                               "vertical median", "rot. deg rmse"}};
  std::string notes;
  for (const EstimateReport& r : reports) {
    lines.push_back(
        {r.system, r.run, std::to_string(r.answers), std::to_string(r.attempts), length(r.rmse_m),
         r.own_rmse_interval_m ? length(r.own_rmse_interval_m->low) + " to " + length(r.own_rmse_interval_m->high)
                               : "-",
         length(r.relative.rmse_m), length(r.error_3d.median), length(r.error_3d.p90), length(r.error_3d.p90_attempts),
         length(r.error_h.median), length(r.error_v.median), NumberText(r.rmse_rot_deg, 3, "-")});
    notes += fmt::format(
        "- {} on {}: poses of the {}, alignment {}; {} of {} images absent; the reference's own 1 sigma in "
        "space is {} {}\n",
        r.system, r.run, r.point, ToString(r.alignment), r.attempts - r.answers, r.attempts, length(r.reference_rms_m),
        unit);
    for (const std::string& note : r.notes) notes += fmt::format("- {} on {}: {}\n", r.system, r.run, note);
  }
  return fmt::format(
      "### Trajectories against the reference poses [{}]\n\n{}\nrmse: absolute trajectory error (ATE); interval by "
      "blocks "
      "in time, its lower end without the reference's uncertainty, which the estimate may share; RPE: relative error "
      "over pieces of {:g} m\n{}",
      unit, AlignMarkdown(lines), reports.empty() ? 0 : reports.front().relative.length_m, notes);
}

nlohmann::json EstimatesJson(const std::vector<EstimateReport>& reports) {
  nlohmann::json all = nlohmann::json::array();
  for (const EstimateReport& r : reports) {
    nlohmann::json j = {{"system", r.system},
                        {"run", r.run},
                        {"point", r.point},
                        {"alignment", ToString(r.alignment)},
                        {"applied_offset_s", r.applied_offset_s},
                        {"attempts", r.attempts},
                        {"answers", r.answers},
                        {"rmse_m", OrNull(r.rmse_m)},
                        {"rmse_rot_deg", OrNull(r.rmse_rot_deg)},
                        {"reference_sigma_m", r.reference_rms_m},
                        {"aligned_rmse_m", OrNull(r.aligned_rmse_m)},
                        {"rmse_with_offset_m", OrNull(r.rmse_with_offset_m)},
                        {"error_3d", Json(r.error_3d)},
                        {"error_h", Json(r.error_h)},
                        {"error_v", Json(r.error_v)},
                        {"notes", r.notes}};
    j["rpe"] = {{"length_m", r.relative.length_m},
                {"pieces", r.relative.pieces},
                {"rmse_m", OrNull(r.relative.rmse_m)},
                {"rmse_deg", OrNull(r.relative.rmse_deg)},
                {"interval_m", OrNull(r.relative.interval_m)}};
    j["own_rmse_interval_m"] = OrNull(r.own_rmse_interval_m);
    if (r.time_offset) {
      j["time_offset"] = {{"offset_s", r.time_offset->offset_s},
                          {"sigma_s", r.time_offset->sigma_s},
                          {"significant", r.time_offset->significant}};
    }
    if (r.lever_arm) {
      const LeverArm& a = *r.lever_arm;
      j["lever_arm"] = {{"arm_m", {a.arm_m.x(), a.arm_m.y(), a.arm_m.z()}},
                        {"sigma_m", {a.sigma_m.x(), a.sigma_m.y(), a.sigma_m.z()}},
                        {"rmse_after_m", a.rmse_after_m},
                        {"significant", a.significant}};
    }
    all.push_back(std::move(j));
  }
  return all;
}

void WriteReferencePoses(const std::vector<ReferencePose>& poses, const std::string& datum,
                         const std::filesystem::path& file) {
  const std::vector<std::string> columns = WithCovarianceColumns(
      {"timestamp", "image",     "camera",    "status",       "reason",       "tags",        "bridged_m",
       "x",         "y",         "z",         "qx",           "qy",           "qz",          "qw",
       "sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg"});
  CsvWriter csv(columns, {"trigpoint reference_poses 1; frame=enu; datum=" + datum +
                          "; sigma=1, rotation about the world's axes; c00..c55: rotation (rad) first, left tangent"});
  for (const ReferencePose& p : poses) {
    csv.Stamp(p.stamp_ns).Text(p.image).Text(p.camera).Text(p.status).Text(p.reason).Integer(p.tags);
    if (!p.world_from_cam) {
      csv.Empty(14 + 36).EndRow();
      continue;
    }
    csv.Number(p.bridged_m, 3);
    for (int i = 0; i < 3; ++i) csv.Number(p.world_from_cam->translation[i], 6);
    for (int i = 0; i < 4; ++i) csv.Number(p.world_from_cam->rotation.coeffs()[i], 9);
    for (int i = 3; i < 6; ++i) csv.Number(std::sqrt(p.covariance(i, i)), 6);
    for (int i = 0; i < 3; ++i) csv.Number(kRadToDeg * std::sqrt(p.covariance(i, i)), 5);
    PutCovariance(p.covariance, &csv);
    csv.EndRow();
  }
  csv.Save(file);
}

std::vector<ReferencePose> ReadReferencePoses(const std::filesystem::path& file) {
  std::vector<ReferencePose> poses;
  const CsvTable table =
      CsvTable::Read(file, {"timestamp", "image", "camera", "status", "x", "y", "z", "qx", "qy", "qz", "qw", "c00"});
  for (const CsvRow& row : table.rows()) {
    ReferencePose p;
    p.stamp_ns = row.StampNs("timestamp");
    p.image = row.Text("image");
    p.camera = row.Text("camera");
    p.status = row.Text("status");
    if (row.Has("reason")) p.reason = row.Text("reason");
    p.tags = static_cast<int>(row.Integer("tags", 0));
    p.bridged_m = row.Number("bridged_m", 0);
    if (row.Has("x")) {
      p.world_from_cam =
          Rigid3d(Eigen::Quaterniond(row.Number("qw"), row.Number("qx"), row.Number("qy"), row.Number("qz")),
                  {row.Number("x"), row.Number("y"), row.Number("z")});
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) p.covariance(i, j) = row.Number(fmt::format("c{}{}", i, j));
      }
    }
    poses.push_back(std::move(p));
  }
  return poses;
}

}  // namespace trigpoint
