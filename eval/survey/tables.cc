#include "eval/survey/tables.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <utility>

#include "calib/geo/geodetic.h"
#include "datasets/export/crs.h"
#include "datasets/io/csv.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

void Three(const Eigen::Vector3d& v, int decimals, CsvWriter* csv) {
  for (int k = 0; k < 3; ++k) csv->Number(v[k], decimals);
}

std::string Comment(const std::string& table, const SurveyResult& result, const SurveyFindings& findings,
                    const std::string& more) {
  return fmt::format("trigpoint {} 1; frame={}; datum={}; sigma=1; {}", table, findings.frame, result.datum, more);
}

void WritePoints(const SurveyResult& result, const SurveyFindings& findings, PointRole role, const fs::path& file) {
  std::vector<std::string> columns = {"point", "tag_id", "status"};
  for (const char* what : {"", "stated_"}) {
    for (const char* axis : {"x", "y", "z"}) columns.push_back(std::string(what) + axis);
  }
  for (const char* column : {"stated_sigma_h_m",
                             "stated_sigma_v_m",
                             "de_m",
                             "dn_m",
                             "du_m",
                             "error_h_m",
                             "error_v_m",
                             "error_3d_m",
                             "sigma_e_m",
                             "sigma_n_m",
                             "sigma_u_m",
                             "covariance_en_m2",
                             "standardised_e",
                             "standardised_n",
                             "standardised_u",
                             "standardised",
                             "chi2_3dof",
                             "left_out_de_m",
                             "left_out_dn_m",
                             "left_out_du_m",
                             "left_out_sigma_e_m",
                             "left_out_sigma_n_m",
                             "left_out_sigma_u_m"}) {
    columns.emplace_back(column);
  }
  CsvWriter csv(columns,
                {Comment(role == PointRole::kControl ? "control" : "check", result, findings,
                         "d: map minus stated; sigmas and standardised values are of that difference; left_out: the "
                         "same if the map were made without the point")});
  for (const PointAgreement& p : result.points) {
    if (p.role != role) continue;
    csv.Text(p.name);
    p.tag_id >= 0 ? csv.Integer(p.tag_id) : csv.Empty();
    csv.Text(StatusOf(p));
    Three(p.stated_m + p.error_m, 5, &csv);
    Three(p.stated_m, 5, &csv);
    csv.Number(p.stated_sigma_h_m, 5).Number(p.stated_sigma_v_m, 5);
    Three(p.error_m, 5, &csv);
    csv.Number(p.error_m.head<2>().norm(), 5).Number(std::abs(p.error_m.z()), 5).Number(p.error_m.norm(), 5);
    const Eigen::Vector3d sigma = p.covariance_m2.diagonal().cwiseMax(0).cwiseSqrt();
    Three(sigma, 5, &csv);
    csv.Number(p.covariance_m2(0, 1), 10);
    // A point that alone holds a direction has no residual there.
    const double least[] = {0.01 * p.stated_sigma_h_m, 0.01 * p.stated_sigma_h_m, 0.01 * p.stated_sigma_v_m};
    for (int k = 0; k < 3; ++k) sigma[k] > least[k] ? csv.Number(p.error_m[k] / sigma[k], 3) : csv.Empty();
    csv.Number(std::sqrt(std::max(0.0, p.chi2)), 3).Number(p.chi2, 3);
    for (int k = 0; k < 3; ++k) p.LeftOutKnown(k) ? csv.Number((*p.left_out_m)[k], 5) : csv.Empty();
    for (int k = 0; k < 3; ++k) p.LeftOutKnown(k) ? csv.Number(p.left_out_sigma_m[k], 5) : csv.Empty();
    csv.EndRow();
  }
  csv.Save(file);
}

// Every picture of a tag.
void WriteResiduals(const SurveyJob& job, const SurveyResult& result, const SurveyFindings& findings,
                    const fs::path& file) {
  CsvWriter csv({"run", "timestamp", "image", "camera", "tag_id", "status", "rms_px", "chi2_8dof", "standardised"},
                {Comment("residuals", result, findings,
                         "corners of a tag in an image: root mean square of their distances from the map's; chi2 of "
                         "the 8 coordinates, with the variance factor of the run; standardised: its root over 8")});
  std::map<std::pair<int64_t, std::string>, std::string> names;
  int named = -1;
  for (const SightResidual& s : result.sights) {
    const SurveyRun& run = job.input.runs[static_cast<size_t>(s.run)];
    if (named != s.run) {
      names.clear();
      for (const ImageDetections& image : run.images) names[{image.stamp_ns, image.camera}] = image.image;
      named = s.run;
    }
    const std::string camera = run.cameras[static_cast<size_t>(s.camera)].name;
    csv.Text(run.name).Stamp(s.stamp_ns).Text(names[{s.stamp_ns, camera}]).Text(camera).Integer(s.tag_id);
    csv.Text(s.used ? "used" : "rejected");
    if (std::isfinite(s.chi2)) {
      csv.Number(s.rms_px, 4).Number(s.chi2, 3).Number(std::sqrt(s.chi2 / 8), 3);
    } else {
      csv.Empty(3);
    }
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteDistances(const SurveyResult& result, const SurveyFindings& findings, const fs::path& file) {
  CsvWriter csv({"from", "to", "role", "status", "measured_m", "stated_sigma_m", "map_m", "difference_m", "sigma_m",
                 "standardised"},
                {Comment("distances", result, findings, "difference: map minus measured, sigma of that difference")});
  for (const DistanceAgreement& d : result.distances) {
    const double difference = d.map_m - d.stated.distance_m;
    csv.Integer(d.stated.from).Integer(d.stated.to).Text(d.stated.check ? "check" : "control");
    csv.Text(d.stated.check ? "check" : d.excluded ? "taken out" : "used");
    csv.Number(d.stated.distance_m, 5).Number(d.stated.sigma_m, 5).Number(d.map_m, 5).Number(difference, 5);
    csv.Number(d.sigma_m, 5);
    d.sigma_m > 0.01 * d.stated.sigma_m ? csv.Number(difference / d.sigma_m, 3) : csv.Empty();
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteBudget(const SurveyResult& result, const SurveyFindings& findings, const fs::path& file) {
  std::vector<std::string> columns = {"tag_id", "sigma_3d_m"};
  for (size_t s = 0; s < kBudgetSources; ++s) {
    columns.push_back(std::string(BudgetName(static_cast<BudgetSource>(s))) + "_m");
  }
  columns.emplace_back("limited_by");
  CsvWriter csv(columns, {Comment("budget", result, findings,
                                  "of the tag's centre, three axes in quadrature; squares of the sources add up")});
  for (const TagBudget& b : result.budgets) {
    csv.Integer(b.tag_id).Number(b.total_m, 5);
    for (const double s : b.sigma_m) csv.Number(s, 5);
    csv.Text(BudgetName(b.LimitedBy()));
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteStationResiduals(const SurveyStations& stations, const SurveyResult& result, const SurveyFindings& findings,
                           const fs::path& file) {
  CsvWriter csv(
      {"setup", "target", "reading", "status", "observed", "stated_sigma", "residual", "unit", "standardised", "line"},
      {Comment("station_residuals", result, findings,
               "residual: map minus read; standardised: over its own sigma; line: of total_station.csv")});
  for (const NetworkResidual& r : result.station_residuals) {
    const StationSighting& s = stations.sightings[r.sighting];
    const bool length = r.reading == StationReading::kDistance;
    const double unit = length ? 1 : kRadToDeg;
    const auto [observed, sigma] = ReadingOf(s, r.reading);
    csv.Text(s.setup).Text(s.target).Text(StationReadingName(r.reading)).Text(r.excluded ? "taken out" : "used");
    csv.Number(observed * unit, 6).Number(sigma * unit, 6).Number(r.residual * unit, 6).Text(length ? "m" : "deg");
    csv.Number(r.standardised, 3).Integer(s.line);
    csv.EndRow();
  }
  csv.Save(file);
}

void WriteSessions(const SurveyJob& job, const SurveyResult& result, const SurveyFindings& findings,
                   const fs::path& file) {
  CsvWriter csv({"run", "kind", "session", "images", "observations", "rejected", "rms_px", "corner_factor", "scale",
                 "scale_sigma", "heading_drift_deg_m", "heading_drift_sigma_deg_m", "odometry_jumps", "repeatability_m",
                 "repeatability_tags"},
                {Comment("sessions", result, findings,
                         "repeatability: root mean square of tags, the map without this run against the map of all")});
  for (size_t r = 0; r < result.runs.size(); ++r) {
    const RunAgreement& run = result.runs[r];
    csv.Text(run.name).Text(run.stills ? "photo set" : "run").Text(job.input.runs[r].date);
    csv.Integer(run.frames).Integer(run.sights).Integer(run.rejected).Number(run.rms_px, 4);
    csv.Number(run.corner_factor, 4);
    run.scale_sigma > 0 ? csv.Number(run.scale, 6).Number(run.scale_sigma, 6) : csv.Empty(2);
    if (!run.stills && run.heading_drift_sigma_deg_m > 0) {
      csv.Number(run.heading_drift_deg_m, 5).Number(run.heading_drift_sigma_deg_m, 5);
    } else {
      csv.Empty(2);
    }
    csv.Integer(static_cast<int64_t>(run.jumps_ns.size()));
    const auto left_out = findings.repeats.without.find(run.name);
    if (left_out != findings.repeats.without.end() && left_out->second.differences > 0) {
      csv.Number(left_out->second.rms_m, 5).Integer(left_out->second.differences);
    } else {
      csv.Empty(2);
    }
    csv.EndRow();
  }
  csv.Save(file);
}

// Tags that another survey has, too: which moved.
void WriteChanges(const SurveyResult& result, const SurveyFindings& findings, const fs::path& file) {
  CsvWriter csv({"tag_id", "status", "de_m", "dn_m", "du_m", "turned_deg", "chi2_6dof"},
                {Comment("changes", result, findings, "against " + findings.against + "; now minus before")});
  for (const TagChange& t : findings.epochs->tags) {
    csv.Integer(t.tag_id).Text(t.moved ? "moved" : "same");
    Three(t.shift_m, 5, &csv);
    csv.Number(t.turn_deg, 4).Number(t.chi2, 2).EndRow();
  }
  csv.Save(file);
}

// Points surveyed at several epochs.
void WriteControlEpochs(const SurveyResult& result, const SurveyFindings& findings, const fs::path& file) {
  CsvWriter csv(
      {"point", "earlier_epoch", "used_epoch", "status", "de_m", "dn_m", "du_m", "sigma_e_m", "sigma_n_m", "sigma_u_m",
       "standardised", "chi2_3dof"},
      {Comment("control_epochs", result, findings, "d: coordinates of the epoch used minus the earlier ones")});
  for (const EpochDifference& d : findings.control.epoch_differences) {
    csv.Text(d.point).Text(d.earlier).Text(d.used).Text(d.Moved() ? "moved" : "same");
    Three(d.difference_m, 5, &csv);
    Three(d.sigma_m, 5, &csv);
    csv.Number(std::sqrt(d.chi2), 3).Number(d.chi2, 3).EndRow();
  }
  csv.Save(file);
}

// Tags in the project's coordinate system.
void WriteTagsInCrs(const Project& project, const SurveyResult& result, const SurveyFindings& findings,
                    const fs::path& file) {
  const Crs crs = Crs::Named(project.crs(), project.frame().origin());
  CsvWriter csv({"tag_id", "role", "status", crs.geographic() ? "longitude_deg" : "easting_m",
                 crs.geographic() ? "latitude_deg" : "northing_m", "height_m", "x", "y", "z", "sigma_x_m", "sigma_y_m",
                 "sigma_z_m"},
                {Comment("tags_crs", result, findings,
                         fmt::format("crs=EPSG:{}; heights are ellipsoidal; x, y, z: site ENU", crs.epsg()))});
  for (const TagEstimate& tag : result.tags) {
    csv.Integer(tag.tag_id).Text(tag.role).Text(tag.status);
    if (!tag.HasPose()) {
      csv.Empty(9).EndRow();
      continue;
    }
    const Geodetic at = project.frame().GeodeticFromEnu(tag.world_from_tag->translation);
    const Eigen::Vector2d place = crs.FromGeodetic(at);
    for (int k = 0; k < 2; ++k) csv.Number(place[k], crs.geographic() ? 10 : 4);
    csv.Number(at.height_m, 4);
    Three(tag.world_from_tag->translation, 5, &csv);
    Three(tag.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt(), 5, &csv);
    csv.EndRow();
  }
  csv.Save(file);
}

}  // namespace

void WriteSurveyTables(const Project& project, const SurveyJob& job, const SurveyResult& result,
                       const SurveyFindings& findings, const fs::path& out, ProgressSink& progress) {
  WritePoints(result, findings, PointRole::kControl, out / "control.csv");
  WritePoints(result, findings, PointRole::kCheck, out / "check.csv");
  WriteResiduals(job, result, findings, out / "residuals.csv");
  WriteDistances(result, findings, out / "distances.csv");
  WriteSessions(job, result, findings, out / "sessions.csv");
  WriteBudget(result, findings, out / "budget.csv");
  if (job.input.stations) WriteStationResiduals(*job.input.stations, result, findings, out / "station_residuals.csv");
  if (!findings.control.epoch_differences.empty()) WriteControlEpochs(result, findings, out / "control_epochs.csv");
  if (findings.epochs) WriteChanges(result, findings, out / "changes.csv");
  if (findings.frame != "enu") return;
  try {
    WriteTagsInCrs(project, result, findings, out / "tags_crs.csv");
  } catch (const IoError&) {
    throw;
  } catch (const Error& e) {
    progress.Log(LogLevel::kWarning, std::string("tags_crs.csv is not written: ") + e.what());
  }
}

}  // namespace trigpoint
