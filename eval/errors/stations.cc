#include "eval/errors/stations.h"

#include <cctype>
#include <set>

namespace trigpoint {

std::string StationNamed(const std::string& name, const std::vector<Station>& stations) {
  const auto number = [](const std::string& text) {
    std::string digits;
    for (const char c : text) {
      if (std::isdigit(static_cast<unsigned char>(c)) != 0) digits += c;
    }
    return digits.empty() || digits.size() > 9 ? -1 : std::stol(digits);
  };
  for (const Station& station : stations) {
    if (station.name == name) return name;
  }
  std::set<std::string> same;
  for (const Station& station : stations) {
    if (number(station.name) >= 0 && number(station.name) == number(name)) same.insert(station.name);
  }
  return same.size() == 1 ? *same.begin() : "";
}

std::string StationOf(const std::string& panorama, const std::string& station, const std::vector<Station>& stations) {
  const std::string& name = station.empty() ? panorama : station;
  const std::string meant = StationNamed(name, stations);
  return meant.empty() ? name : meant;
}

std::optional<Eigen::Vector3d> StationCentre(const Station& station, const Rigid3d& map_from_tag,
                                             const std::optional<Eigen::Matrix3d>& enu_from_map,
                                             const std::optional<Eigen::Vector3d>& up_in_map, std::string* reason) {
  if (!station.in_tag_frame) {
    if (!enu_from_map && !station.offset_m.isZero()) {
      *reason = "the offset of station " + station.name +
                " is east/north/up, but the run has no global fit to give north; measure right/out/up instead";
      return std::nullopt;
    }
    return map_from_tag.translation +
           (enu_from_map ? Eigen::Vector3d(enu_from_map->transpose() * station.offset_m) : Eigen::Vector3d::Zero());
  }
  if (!up_in_map) {
    *reason = "the offset of station " + station.name +
              " is right/out/up, but the vertical of the run's frame is not known (no global fit, and run.yaml does "
              "not say odometry.levelled)";
    return std::nullopt;
  }
  const Eigen::Vector3d up = up_in_map->normalized();
  const Eigen::Vector3d x = map_from_tag.rotation * Eigen::Vector3d::UnitX();
  Eigen::Vector3d right = x - up.dot(x) * up;
  if (right.norm() < 0.1) {
    *reason = "tag " + std::to_string(station.tag_id) + " is turned on its side, so that right/out/up has no meaning";
    return std::nullopt;
  }
  right.normalize();
  return map_from_tag.translation + station.offset_m.x() * right + station.offset_m.y() * right.cross(up) +
         station.offset_m.z() * up;
}

Eigen::Matrix<double, 3, 6> CentreFromTag(const Station& station, const Rigid3d& map_from_tag,
                                          const Eigen::Vector3d& centre, const std::optional<Eigen::Vector3d>& up) {
  Eigen::Matrix<double, 3, 6> j = Eigen::Matrix<double, 3, 6>::Zero();
  j.rightCols<3>().setIdentity();
  if (station.in_tag_frame && up) {
    j.leftCols<3>() = up->cross(centre - map_from_tag.translation) * up->transpose();
  }
  return j;
}

}  // namespace trigpoint
