#include "survey/input/satellites.h"

#include <algorithm>
#include <cmath>

#include "calib/geo/geodetic.h"
#include "datasets/io/camchain.h"
#include "datasets/io/gps.h"
#include "survey/input/known_points.h"

namespace trigpoint {

std::vector<SurveyPoint> GeotagPoints(const Project& project) {
  std::vector<SurveyPoint> points;
  if (!project.has_frame()) return points;
  for (const Reference& reference : project.site().references) {
    if (!reference.geotag.has_position) continue;
    for (const Station& station : project.site().stations) {
      if (station.name != reference.station || project.review().ExcludesStation(station.name)) continue;
      SurveyPoint p;
      p.name = reference.name;
      p.role = PointRole::kGeotag;
      p.tag_id = station.tag_id;
      p.offset_m = station.offset_m;
      p.offset_in_tag_frame = station.in_tag_frame;
      p.world_m = project.frame().EnuFromGeodetic(reference.geotag.position);
      if (!reference.geotag.has_height) p.world_m.z() = 0;  // the site's origin is the best guess
      p.sigma_h_m = std::hypot(reference.geotag.sigma_h_m, station.sigma_m);
      p.sigma_v_m =
          reference.geotag.has_height ? std::hypot(reference.geotag.sigma_v_m, station.sigma_m) : kUnknownHeightSigma;
      points.push_back(p);
    }
  }
  return points;
}

void AddGps(const Project& project, const Run& run, SurveyRun* survey) {
  if (!project.has_frame()) return;
  std::vector<int64_t> stamps;
  for (const ImageDetections& image : survey->images) {  // on the body's clock, as the map's frames are
    const size_t camera = CameraNamed(*survey, image.camera);
    if (camera >= survey->cameras.size()) continue;
    stamps.push_back(BodyStamp(image.stamp_ns, survey->cameras[camera]));
  }
  for (const SurveyTie& tie : survey->ties) stamps.push_back(tie.stamp_ns);
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  for (const GpsFix& fix : run.gps) {
    const auto at = NearestToFix(stamps, fix);
    if (!at) continue;
    survey->gps.push_back({stamps[*at], run.config.gps_lever_arm_m, project.frame().EnuFromGeodetic(fix.position),
                           fix.sigma_h_m, fix.sigma_v_m, fix.sigma_sea_m});
  }
}

}  // namespace trigpoint
