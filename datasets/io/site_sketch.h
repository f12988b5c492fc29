// A sketch of a site before anything is measured: plan.csv or plan.geojson (docs/file_formats.md).
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/geo/geodetic.h"

namespace trigpoint {

// 1 sigma of the geotag of a station's panorama, horizontal (per axis) and vertical, unless stated.
constexpr double kSketchGeotag_h_m = 1, kSketchGeotag_v_m = 2;

struct SketchItem {
  std::string kind;                        // tag, candidate, control, check, station, path, candidate_path
  std::string name;                        // tag, control, check: the tag's id; paths: the pass it is a corner of
  std::optional<Eigen::Vector3d> local_m;  // east, north, up; or
  std::optional<Geodetic> geodetic;
  std::optional<double> heading_rad;           // the way a tag's printed side faces, clockwise from north
  double size_m = 0;                           // of a tag; 0: as in tags.yaml
  double sigma_h_m = 0.01, sigma_v_m = 0.015;  // 1 sigma per axis: of control; of the geotag of a station's panorama
  int tag_id = -1;                             // of a tag, control or check; of a station the tag beside it
  std::string where;                           // file and row or feature it was read from
};

// CSV: kind,name and east_m,north_m,up_m or latitude_deg,longitude_deg,height_m; optional heading_deg, size_mm,
// sigma_h_m, sigma_v_m, tag_id. GeoJSON: points, and lines for paths, with these as properties. Throws InputError
// naming file and row or feature; also for an object that is there twice, and for a site wider than 20 km.
std::vector<SketchItem> ReadSiteSketch(const std::filesystem::path& file);
// Throws InputError for the first item whose tag_id the site's families lack; `family`: as TagSizes has it.
void RequireTagIds(const std::vector<SketchItem>& items, const std::string& family);
// As plan.csv; ReadSiteSketch gives the same items back, positions to a millimetre.
std::string SiteSketchCsv(const std::vector<SketchItem>& items);

}  // namespace trigpoint
