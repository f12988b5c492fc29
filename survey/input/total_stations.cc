#include "survey/input/total_stations.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "datasets/io/tables.h"
#include "survey/input/known_points.h"
#include "survey/tags/total_station.h"

namespace trigpoint {
namespace {

// Control by the names that total_station.csv has for it.
std::vector<NetworkPoint> NetworkControl(const Project& project) {
  std::vector<NetworkPoint> control;
  for (const ControlPoint& c : AtNewestEpoch(project.site().control_points)) {
    const std::optional<Eigen::Vector3d> world = WorldOf(project, c);
    if (!world || !c.control) continue;
    std::string name = c.tag_id < 0 ? c.point : fmt::format("tag:{}", c.tag_id);
    if (c.tag_id >= 0 && c.corner >= 0) name += fmt::format("/{}", c.corner);
    control.push_back({name, *world, c.sigma_h_m, c.sigma_v_m});
  }
  return control;
}

}  // namespace

namespace fs = std::filesystem;

void AddStations(const Project& project, const std::optional<LocalFrame>& enu, const CancelToken& cancel,
                 SurveyJob* job) {
  const fs::path file = project.dir() / "total_station.csv";
  if (!fs::exists(file)) return;
  SurveyStations stations;
  stations.sightings = ReadTotalStation(file, &job->warnings);
  if (stations.sightings.empty()) return;
  stations.known = NetworkControl(project);
  stations.level_from_world = LevelFromWorld(stations.known, stations.sightings, enu);
  stations.network = AdjustNetwork(stations.sightings, stations.known, cancel, stations.level_from_world);
  const StationNetwork& network = stations.network;
  job->warnings.insert(job->warnings.end(), network.warnings.begin(), network.warnings.end());
  if (!network.unplaced.empty()) {
    job->warnings.push_back(
        fmt::format("total_station.csv: {} cannot be placed from the control points and take no part",
                    fmt::join(network.unplaced, ", ")));
  }
  for (size_t k = 0; k < network.points.size(); ++k) {
    const NetworkPoint& point = network.points[k];
    const auto tag = TagOfTarget(point.name);
    const bool known = std::any_of(stations.known.begin(), stations.known.end(),
                                   [&](const NetworkPoint& p) { return p.name == point.name; });
    if (!tag || known) continue;
    const auto at = 3 * static_cast<Eigen::Index>(k);
    const Eigen::Vector3d variance = network.covariance.diagonal().segment<3>(at);
    SurveyPoint p;
    p.name = point.name;
    p.start_only = true;
    p.tag_id = tag->first, p.corner = tag->second;
    p.world_m = point.position;
    p.sigma_h_m = std::sqrt(0.5 * (variance.x() + variance.y()));
    p.sigma_v_m = std::sqrt(variance.z());
    job->input.points.push_back(p);
  }
  job->input.stations = std::move(stations);
}

bool IsInNetwork(const SurveyJob& job, const std::string& point) {
  if (!job.input.stations) return false;
  const std::vector<NetworkPoint>& points = job.input.stations->network.points;
  return std::any_of(points.begin(), points.end(), [&](const NetworkPoint& p) { return p.name == point; });
}

}  // namespace trigpoint
