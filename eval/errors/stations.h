// Where a station is, by its tag's pose and the measured offset; which one an answer belongs to.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/geometry/rigid3.h"
#include "datasets/io/site.h"

namespace trigpoint {

// The centre of a station from its tag's pose, in the tag's frame of reference `map`.
// `enu_from_map`: rotation from the map to east-north-up (identity for a world map); unset when unknown.
// `up_in_map`: unit vertical in the map frame; unset when unknown.
// Offsets east/north/up need enu_from_map; right/out/up need up_in_map: right is the tag's x axis made level, out the
// horizontal normal away from the tag's face towards the reader, up the vertical. Unset with `reason` otherwise.
std::optional<Eigen::Vector3d> StationCentre(const Station& station, const Rigid3d& map_from_tag,
                                             const std::optional<Eigen::Matrix3d>& enu_from_map,
                                             const std::optional<Eigen::Vector3d>& up_in_map, std::string* reason);

// d centre / d (the tag's left tangent), map axes. An offset in the tag's levelled frame turns with the tag's heading
// (about `up`); one in east, north, up does not.
Eigen::Matrix<double, 3, 6> CentreFromTag(const Station& station, const Rigid3d& map_from_tag,
                                          const Eigen::Vector3d& centre, const std::optional<Eigen::Vector3d>& up);

// The station a panorama's or photo set's name means: itself, or the only one with the same number ("station_099" is
// S99). Empty if there is none.
std::string StationNamed(const std::string& name, const std::vector<Station>& stations);

// The name of the station that an answer for a panorama belongs to; `station` as the result has it, may be empty.
std::string StationOf(const std::string& panorama, const std::string& station, const std::vector<Station>& stations);

}  // namespace trigpoint
