// What a survey brings beside pictures: measured distances, and surveyed points marked in pictures. Bad rows are
// skipped and named in `warnings`.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "datasets/io/site.h"

namespace trigpoint {

// distances.csv: from,to,distance_m[,sigma_m,role]; between the centres of two tags.
struct MeasuredDistance {
  int from = -1, to = -1;
  double distance_m = 0;
  double sigma_m = 0.005;
  bool check = false;  // role check: compared, not used
};
std::vector<MeasuredDistance> ReadDistances(const std::filesystem::path& file, std::vector<std::string>* warnings);

// Where a point of control_points.csv is seen.
struct PointMark {
  std::string point;
  std::string image;  // as in images.txt, or the end of its path
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  bool normalised = false;  // OpenSfM: (pixel - image centre) / larger side
  double sigma_px = 1;      // 1 sigma per axis
};
// Whether an image that a table names is the one of `path`: all of the path, or its end after a slash.
bool NamesPath(const std::string& named, const std::string& path);
// control_observations.csv: point,image,u,v[,sigma_px]; our pixels.
std::vector<PointMark> ReadControlObservations(const std::filesystem::path& file, std::vector<std::string>* warnings);

// Points and where they are seen, as OpenSfM keeps them.
struct OpenSfmControl {
  std::vector<ControlPoint> points;  // without a role
  std::vector<PointMark> marks;
};
// ground_control_points.json: {"points": [{"id", "position": {latitude, longitude, altitude}, "observations":
// [{"shot_id", "projection": [x, y]}]}]}. Points without a position are kept as marks alone.
OpenSfmControl ReadOpenSfmJson(const std::filesystem::path& file, std::vector<std::string>* warnings);
// gcp_list.txt, as OpenDroneMap and OpenSfM have it: first the system (see InputCrs, or WGS84, "WGS84 UTM 32N"), then
// lines "x y z u v image [name] [more]"; heights are above the ellipsoid unless the system has its own. A name that
// begins with CHK, or a word CHK behind it, makes a check point; then the others are control.
OpenSfmControl ReadOpenSfmList(const std::filesystem::path& file, std::vector<std::string>* warnings);

}  // namespace trigpoint
