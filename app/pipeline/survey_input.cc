#include "app/pipeline/survey_input.h"

#include "app/pipeline/reviewed.h"
#include "survey/tags/control.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

std::optional<Eigen::Vector3d> WorldOf(const Project& project, const ControlPoint& point) {
  if (point.local_m) return point.local_m;
  if (point.geodetic && project.has_frame()) return project.frame().EnuFromGeodetic(*point.geodetic);
  return std::nullopt;
}

void AddControl(const Project& project, SurveyJob* job) {
  std::vector<SurveyPoint> points;
  bool roles = false;
  for (const ControlPoint& c : project.site().control_points) roles |= c.has_role;
  for (const ControlPoint& c : project.site().control_points) {
    const std::optional<Eigen::Vector3d> world = WorldOf(project, c);
    if (!world || c.tag_id < 0) continue;
    SurveyPoint p;
    p.name = ReviewControlName(c);
    p.role = c.control ? PointRole::kControl : PointRole::kCheck;
    p.tag_id = c.tag_id;
    p.corner = c.corner;
    p.world_m = *world;
    p.sigma_h_m = c.sigma_h_m;
    p.sigma_v_m = c.sigma_v_m;
    points.push_back(p);
  }
  if (!roles && !points.empty()) {
    const int withheld = WithholdChecks(&points);
    job->check_note =
        withheld > 0 ? "no roles are given: every third surveyed point is withheld as check, " +
                           std::to_string(withheld) + " of " + std::to_string(points.size())
                     : "no independent check: withholding one would leave fewer than three well-spread control points";
  }
  for (const SurveyPoint& p : points) job->has_check |= p.role == PointRole::kCheck;
  if (job->check_note.empty() && !job->has_check && !points.empty()) {
    job->check_note = "no independent check: every surveyed point has the role control";
  }
  job->input.points.insert(job->input.points.end(), points.begin(), points.end());
}

// A panorama's geotag says where its station's tag is, less the measured offset.
void AddGeotags(const Project& project, SurveyJob* job) {
  if (!project.has_frame()) return;
  for (const Reference& reference : project.site().references) {
    if (!reference.geotag.has_position) continue;
    for (const Station& station : project.site().stations) {
      if (station.name != reference.station || station.in_tag_frame) continue;
      if (project.review().ExcludesStation(station.name)) continue;
      SurveyPoint p;
      p.name = reference.name;
      p.role = PointRole::kGeotag;
      p.tag_id = station.tag_id;
      p.offset_m = station.offset_m;
      p.world_m = project.frame().EnuFromGeodetic(reference.geotag.position);
      p.sigma_h_m = std::hypot(reference.geotag.sigma_h_m, station.sigma_m);
      p.sigma_v_m = reference.geotag.has_height ? std::hypot(reference.geotag.sigma_v_m, station.sigma_m) : 100;
      job->input.points.push_back(p);
    }
  }
}

}  // namespace

std::vector<const Run*> SurveyRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "evaluation") runs.push_back(&run);
  }
  return runs;
}

SurveyJob MakeSurveyJob(const Project& project, const StageTarget& target, const std::string& datum) {
  SurveyJob job;
  job.input.sizes = project.site().tags;
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its = target;
    its.run = run->name;
    const fs::path file = ResultOf(project, "detect", its) / "detections.csv";
    if (!fs::exists(file)) {
      job.warnings.push_back("run " + run->name + " has no detections and takes no part");
      continue;
    }
    SurveyRun survey;
    survey.name = run->name;
    survey.cameras = run->cameras;
    survey.images = ReadDetections(file, 0.5, &job.warnings);
    LeaveOutExcluded(project.review(), run->name, survey.images);
    survey.odometry = run->odometry;
    survey.scale_sigma = run->config.odometry_scale_sigma;
    job.input.runs.push_back(std::move(survey));
  }
  if (job.input.runs.empty()) throw InputError("no run has detections: run `trigpoint detect` first");
  if (datum == "auto" || datum == "control") AddControl(project, &job);
  if (datum == "auto" || datum == "geotags") AddGeotags(project, &job);
  return job;
}

}  // namespace trigpoint
