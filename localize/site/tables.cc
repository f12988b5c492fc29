#include "localize/site/tables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>
#include <string>
#include <vector>

#include "calib/geo/geodetic.h"
#include "datasets/solution/covariance_tables.h"
#include "datasets/solution/reference_rows.h"
#include "datasets/solution/solution_covariance.h"
#include "localize/files/tables.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::string Comment(const SiteAdjustment& site, const char* table) {
  return std::string("trigpoint ") + table + " 1; frame=enu; datum=" + site.solution.georeference->source + "; sigma=1";
}

// A run's cameras as `localize` writes them.
void WriteRun(const SiteAdjustment& site, size_t index, const fs::path& dir) {
  const Solution part = PartOfRun(site.solution, index);
  LocalizeInput input;
  input.cameras = part.cameras;
  input.frame = LocalFrame(part.georeference->origin);
  Localization result;
  result.on_earth = true;
  result.earth_source = part.georeference->source;
  input.images = part.images;
  for (const SolutionImage& image : part.images) {
    result.cameras.push_back({OdomFromCam(part, image), ImageWorldCovariance(part, image)});
  }
  fs::create_directories(dir);
  WriteCameras(input, result, dir);
  WriteCameraCovariances(part, dir);
}

void PutPlaced(CsvWriter& csv, const Solution& s, const ReferenceRow& row, const LocalFrame& frame) {
  const SolutionReference& r = s.references[row.shown];
  const Rigid3d& pose = row.odom_from_pano;
  PutWorldPose(csv, {pose, WorldCovariance(s, row)});
  PutGeodeticPose(csv, frame, pose);
  if (r.geotag.empty()) {
    csv.Empty(3).Text("unused");
    return;
  }
  const Eigen::Vector3d to_shown = OdomFromRig(s, r.pose).translation - pose.translation;
  for (double d : Eigen::Vector3d(r.geotag_difference + to_shown)) csv.Number(d, 4);
  csv.Text(r.geotag);
}

void WritePanoramas(const SiteAdjustment& site, const fs::path& dir) {
  const Solution& s = site.solution;
  CsvWriter csv({"panorama",
                 "station",
                 "status",
                 "reason",
                 "x",
                 "y",
                 "z",
                 "qx",
                 "qy",
                 "qz",
                 "qw",
                 "sigma_x_m",
                 "sigma_y_m",
                 "sigma_z_m",
                 "latitude_deg",
                 "longitude_deg",
                 "height_m",
                 "heading_deg",
                 "pitch_deg",
                 "roll_deg",
                 "geotag_de_m",
                 "geotag_dn_m",
                 "geotag_du_m",
                 "geotag_status",
                 "runs"},
                {Comment(site, "panoramas")});
  const LocalFrame frame(s.georeference->origin);
  for (const ReferenceRow& row : ReferenceRows(s)) {
    const SolutionReference& r = s.references[row.shown];
    csv.Text(row.name).Text(r.station).Text(r.status).Text(r.reason);
    if (row.localized.empty()) {
      csv.Empty(20);
    } else {
      PutPlaced(csv, s, row, frame);
    }
    std::set<int> of_row;
    for (const size_t i : row.references)
      of_row.insert(site.runs_of_reference[i].begin(), site.runs_of_reference[i].end());
    std::vector<std::string> runs;
    for (int run : of_row) runs.push_back(s.runs[static_cast<size_t>(run)].name);
    csv.Text(fmt::format("{}", fmt::join(runs, "+")));
    csv.EndRow();
  }
  csv.Save(dir / "panoramas.csv");
}

void WriteTags(const SiteAdjustment& site, const fs::path& dir) {
  CsvWriter csv({"tag_id", "x", "y", "z", "qx", "qy", "qz", "qw", "sigma_x_m", "sigma_y_m", "sigma_z_m"},
                {Comment(site, "site_tags")});
  for (size_t i = 0; i < site.tags.size(); ++i) {
    const int pose = site.fit.first_tag + static_cast<int>(i);
    csv.Integer(site.tags[i]);
    PutWorldPose(csv, {OdomFromRig(site.solution, pose), WorldCovariance(site.solution, pose)});
    csv.EndRow();
  }
  csv.Save(dir / "tags.csv");
}

void WriteRuns(const SiteAdjustment& site, const fs::path& dir) {
  CsvWriter csv({"run", "images", "shared_panoramas", "shared_tags", "shared_points", "odometry_scale",
                 "odometry_scale_sigma", "largest_move_m"},
                {"trigpoint site_runs 1; sigma=1; moves against the run by itself"});
  for (const RunInSite& run : site.runs) {
    csv.Text(run.name).Integer(run.images).Integer(run.shared_panoramas).Integer(run.shared_tags);
    csv.Integer(run.shared_points).Number(run.scale, 6).Number(run.scale_sigma, 6).Number(run.largest_move_m, 4);
    csv.EndRow();
  }
  csv.Save(dir / "runs.csv");
}

}  // namespace

void WriteSiteTables(const SiteAdjustment& site, const fs::path& dir) {
  WriteRuns(site, dir);
  WritePanoramas(site, dir);
  WriteTags(site, dir);
  for (size_t i = 0; i < site.solution.runs.size(); ++i) WriteRun(site, i, dir / site.solution.runs[i].name);
  WritePanoramaCovariances(site.solution, dir);
}

}  // namespace trigpoint
