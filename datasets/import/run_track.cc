#include "datasets/import/run_track.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/io/csv.h"

namespace trigpoint {

SearchArea AreaAlongRun(const std::filesystem::path& site, const std::string& run, double radius_m) {
  std::vector<Geodetic> track;
  std::vector<double> sigmas;
  for (const GpsFix& fix : ReadRun(site / "runs" / run, site).gps) {
    track.push_back(fix.position);
    sigmas.push_back(fix.sigma_h_m);
  }
  const std::filesystem::path cameras = site / "results" / "localize" / run / "cameras.csv";
  if (track.empty() && std::filesystem::exists(cameras)) {
    const CsvTable table = CsvTable::Read(cameras, {"latitude_deg", "longitude_deg", "sigma_e_m", "sigma_n_m"});
    for (const CsvRow& row : table.rows()) {
      if (!row.Has("latitude_deg")) continue;
      track.push_back({row.Number("latitude_deg"), row.Number("longitude_deg"), 0});
      sigmas.push_back(std::max(row.Number("sigma_e_m", 0), row.Number("sigma_n_m", 0)));
    }
  }
  if (track.empty()) {
    throw InputError("run " + run +
                     ": it has no position; give GPS (gps.csv, *.gpx, *.nmea, or EXIF "
                     "positions), or use --near LAT,LON");
  }
  SearchArea area;
  area.radius_m = radius_m + 2 * Median(sigmas);
  Eigen::Vector3d last = Eigen::Vector3d::Constant(1e12);
  for (const Geodetic& point : track) {
    const Eigen::Vector3d at = EcefFromGeodetic({point.latitude_deg, point.longitude_deg, 0});
    if ((at - last).norm() < 0.25 * radius_m) continue;
    area.points.push_back(point);
    last = at;
  }
  return area;
}

}  // namespace trigpoint
