#include "survey/input/control.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/counted.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/tables.h"
#include "survey/input/known_points.h"
#include "survey/input/total_stations.h"
#include "survey/tags/control.h"

namespace trigpoint {
namespace {

// The newest epoch of each point is used, earlier ones are compared with it. Points of several epochs may be apart by
// the motion of their plate.
void UseNewestEpochs(const Project& project, std::vector<ControlPoint>* points, SurveyJob* job) {
  constexpr double kApart_years = 1;
  const std::vector<ControlPoint> all = std::exchange(*points, AtNewestEpoch(*points));
  ControlSystems& control = job->control;
  control.crs = StatedSystems(project, all);
  for (const ControlPoint& c : all) {
    control.epochs.insert(c.epoch);
    if (c.geodetic) control.heights.insert(c.height_system);
    for (const ControlPoint& used : *points) {
      if (ReviewControlName(used) != ReviewControlName(c) || used.epoch == c.epoch) continue;
      const auto now = WorldOf(project, used), then = WorldOf(project, c);
      if (!now || !then) continue;
      EpochDifference d{ReviewControlName(c), c.epoch, used.epoch, *now - *then};
      const double h = std::hypot(c.sigma_h_m, used.sigma_h_m);
      d.sigma_m = {h, h, std::hypot(c.sigma_v_m, used.sigma_v_m)};
      d.chi2 = d.difference_m.cwiseQuotient(d.sigma_m).squaredNorm();
      control.epoch_differences.push_back(d);
      if (!d.Moved()) continue;
      job->warnings.push_back(fmt::format(
          "point {}: its coordinates of epoch {} are {:.3f} m from those of epoch {}, {:.1f} sigma: the newer ones are "
          "used; check whether the point moved and whether both epochs have the same coordinate system",
          d.point, d.earlier, d.difference_m.norm(), d.used, std::sqrt(d.chi2)));
    }
  }
  std::map<double, std::string> years;
  for (const ControlPoint& c : *points) {
    const auto year = YearOfEpoch(c.epoch);
    if (year && c.geodetic) years[*year] = c.epoch;
  }
  if (!years.empty() && years.rbegin()->first - years.begin()->first > kApart_years) {
    job->warnings.push_back(fmt::format(
        "the surveyed points are of epochs {} to {} and are used as stated; in a frame that does not move with the "
        "site's plate their coordinates change by centimetres a year: transform them to one epoch",
        years.begin()->second, years.rbegin()->second));
  }
}

}  // namespace

void AddControl(const Project& project, bool used, SurveyJob* job) {
  std::vector<SurveyPoint> points;
  bool roles = false;
  KnownPoints known = ReadKnownPoints(project, &job->warnings);
  UseNewestEpochs(project, &known.points, job);
  for (const ControlPoint& c : known.points) roles |= c.has_role;
  bool local = true;
  for (const ControlPoint& c : known.points) {
    const std::optional<Eigen::Vector3d> world = WorldOf(project, c);
    if (!world) continue;
    local &= c.local_m.has_value();
    SurveyPoint p;
    p.name = ReviewControlName(c);
    p.role = c.control && used ? PointRole::kControl : PointRole::kCheck;
    p.tag_id = c.tag_id;
    p.corner = c.corner;
    p.world_m = *world;
    p.sigma_h_m = c.sigma_h_m;
    p.sigma_v_m = c.sigma_v_m;
    if (c.tag_id < 0) {
      p.marks = MarksOf(project, c.point, known, job->input, &job->warnings);
      if (p.marks.size() < 2 && IsInNetwork(*job, c.point)) continue;
      if (p.marks.size() < 2) {
        job->warnings.push_back(fmt::format("point {} is marked in {} of the survey runs; expected two or more",
                                            c.point, Counted(p.marks.size(), "picture")));
        continue;
      }
    }
    points.push_back(p);
  }
  if (points.empty()) return;
  job->local_frame = local;
  if (!used) {
    job->check_note = "control takes no part in this datum: all surveyed points are check points";
  } else if (!roles) {
    const int withheld = WithholdChecks(&points);
    job->check_note =
        withheld > 0 ? fmt::format(
                           "no roles are given: every third surveyed tag or point is withheld as check, {} of {} "
                           "points",
                           withheld, points.size())
                     : "no independent check: withholding a point would leave fewer than three well-spread control "
                       "points; leave-one-out residuals instead";
  }
  for (const SurveyPoint& p : points) job->has_check |= p.role == PointRole::kCheck;
  if (job->check_note.empty() && !job->has_check) {
    job->check_note =
        "no independent check: every surveyed point has the role control; leave-one-out residuals instead";
  }
  job->input.points.insert(job->input.points.end(), points.begin(), points.end());
}

void AddDistances(const Project& project, SurveyJob* job) {
  const std::filesystem::path file = project.dir() / "distances.csv";
  if (!std::filesystem::exists(file)) return;
  for (const MeasuredDistance& d : ReadDistances(file, &job->warnings)) {
    job->input.distances.push_back({d.from, d.to, d.distance_m, d.sigma_m, d.check});
  }
}

}  // namespace trigpoint
