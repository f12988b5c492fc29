#include "survey/input/site_frame.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/io/gps.h"
#include "datasets/io/tables.h"
#include "survey/input/satellites.h"

namespace trigpoint {
namespace {

constexpr double kOneSite_m = 50'000;  // surveyed points and satellite fixes of one site are nearer
constexpr double kSameFrame_m = 100;   // coordinates about the site's origin are nearer
constexpr double kGeoid_m = 130;       // heights above ellipsoid and sea differ by less, receivers' errors included
constexpr double kFoot_m = 0.3048;

}  // namespace

std::optional<LocalFrame> FrameOfControl(const Project& project, const SurveyInput& input) {
  if (!project.has_frame()) return std::nullopt;
  std::vector<double> control[2], satellites[2];
  for (const ControlPoint& c : AtNewestEpoch(project.site().control_points)) {
    if (!c.control) continue;
    if (!c.local_m) return project.frame();
    for (int k = 0; k < 2; ++k) control[k].push_back((*c.local_m)[k]);
  }
  for (const SurveyPoint& p : GeotagPoints(project)) {
    for (int k = 0; k < 2; ++k) satellites[k].push_back(p.world_m[k]);
  }
  for (const SurveyRun& run : input.runs) {
    for (const SurveyFix& fix : run.gps) {
      for (int k = 0; k < 2; ++k) satellites[k].push_back(fix.world_m[k]);
    }
  }
  if (control[0].empty()) return project.frame();
  const bool fixed = !satellites[0].empty();
  const double east = fixed ? Median(satellites[0]) : 0, north = fixed ? Median(satellites[1]) : 0;
  if (std::hypot(Median(control[0]) - east, Median(control[1]) - north) > (fixed ? kSameFrame_m : kOneSite_m)) {
    return std::nullopt;
  }
  return project.frame();
}

void RequireOneSite(const Project& project, SurveyJob* job) {
  if (!project.has_frame()) return;
  const bool local = job->local_frame;
  job->local_frame = false;  // about the site's origin, unless satellites contradict
  SurveyInput& input = job->input;
  struct Places {
    std::vector<double> east, north, height;
    void Add(const LocalFrame& frame, const Eigen::Vector3d& place, double sigma_v_m) {
      east.push_back(place.x()), north.push_back(place.y());
      if (sigma_v_m < kUnknownHeightSigma) height.push_back(frame.GeodeticFromEnu(place).height_m);
    }
  };
  Places surveyed, satellites;
  for (const SurveyPoint& p : input.points) {
    (p.role == PointRole::kGeotag ? satellites : surveyed).Add(project.frame(), p.world_m, p.sigma_v_m);
  }
  for (const SurveyRun& run : input.runs) {
    for (const SurveyFix& fix : run.gps) satellites.Add(project.frame(), fix.world_m, fix.sigma_v_m);
  }
  if (surveyed.east.empty() || satellites.east.empty()) return;
  const double apart =
      std::hypot(Median(surveyed.east) - Median(satellites.east), Median(surveyed.north) - Median(satellites.north));
  if (local && apart > kSameFrame_m && input.use_control) {
    job->local_frame = true;
    job->warnings.push_back(
        fmt::format("control_points.csv: x_m, y_m, z_m are {:.0f} m from the site's position by geotags and GPS, so "
                    "they are taken as coordinates of a local frame; the map is made in it, without geotags and GPS",
                    apart));
    std::erase_if(input.points, [](const SurveyPoint& p) { return p.role == PointRole::kGeotag; });
    for (SurveyRun& run : input.runs) run.gps.clear();
    return;
  }
  if (apart > kOneSite_m) {
    throw InputError(
        fmt::format("control_points.csv: the surveyed points lie {:.0f} km from the geotags and GPS fixes: check the "
                    "zone, the EPSG code, and whether latitude and longitude are swapped; option --set "
                    "survey.check_conventions=false skips this check",
                    1e-3 * apart));
  }
  if (surveyed.height.empty() || satellites.height.empty()) return;
  const double theirs = Median(surveyed.height), ours = Median(satellites.height);
  if (std::abs(theirs - ours) < kGeoid_m) return;
  const bool feet = std::abs(theirs * kFoot_m - ours) < kGeoid_m,
             geotag_feet = std::abs(ours * kFoot_m - theirs) < kGeoid_m;
  throw InputError(fmt::format(
      "control_points.csv: the surveyed heights (median {:.0f} m) differ from those of geotags and GPS (median {:.0f} "
      "m) by more than any geoid height{}; option --set survey.check_conventions=false skips this check",
      theirs, ours,
      feet          ? ": they seem to be in feet, expected metres"
      : geotag_feet ? ": those of the geotags seem to be in feet, expected metres"
                    : ": check the unit, the sign and the height system"));
}

}  // namespace trigpoint
