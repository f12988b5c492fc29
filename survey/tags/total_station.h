// Horizontal directions, zenith angles and slope distances from the set-ups of a total station, and the network that
// they make of known points and tags.
//
// World is the site's ENU or a frame of the surveyor's own; either may begin far from the site. Angles are predicted in
// a level frame that begins at the site, where its z axis is vertical (LevelFromWorld). At a set-up the instrument's
// vertical is the plumb line there, which on a sphere of 6371 km leans outwards with the distance from the level
// frame's origin, to first order (within 1e-5 rad up to 10 km): so the Earth's curvature is in the geometry. Refraction
// raises what is seen by k s / 2R, k = 0.13 (Kahmen, Faig 1988, section 5.4). Distances are those between the points:
// corrected for the atmosphere and the prism by the instrument.
#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/base/progress.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

enum class StationReading { kDirection, kZenith, kDistance };
std::string_view StationReadingName(StationReading reading);

// predicted - observed over sigma, one residual. Blocks: the instrument's centre (3, world, m); the target (a point, 3,
// or world_from_tag, 7); of a direction the orientation, too (1, rad): azimuth in the level frame, clockwise from its y
// axis, of the circle's zero.
class StationCost final : public ceres::CostFunction {
 public:
  // `lever`: where the target is on the tag, tag frame, m; unset: the target is a point. target_height_m: of the prism
  // above it.
  StationCost(StationReading reading, double observed, double sigma, const std::optional<Eigen::Vector3d>& lever,
              double target_height_m, const Rigid3d& level_from_world = {});
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  StationReading reading_;
  double observed_, sigma_;
  std::optional<Eigen::Vector3d> lever_;
  double target_height_m_;
  Rigid3d level_from_world_;
};

// A target as seen from a set-up: what was read of it.
struct StationSighting {
  std::string setup, target;
  std::optional<double> direction_rad, zenith_rad, distance_m;  // direction: clockwise from the circle's zero
  double sigma_direction_rad = 1.5e-5, sigma_zenith_rad = 1.5e-5, sigma_distance_m = 0.002;
  double instrument_height_m = 0, target_height_m = 0;  // above the set-up's point, above the target
  int line = 0;                                         // of the file
};

struct NetworkPoint {
  std::string name;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world, m
  double sigma_h_m = 0, sigma_v_m = 0;                 // of a known point, per axis
};

struct NetworkResidual {
  size_t sighting = 0;
  StationReading reading = StationReading::kDirection;
  double residual = 0;      // predicted - observed, rad or m
  double standardised = 0;  // over its own sigma (Baarda 1968); of an excluded one as it was when it was taken out
  bool excluded = false;
};

// Where an instrument stands, and how its circle lies.
struct StationSetup {
  std::string name;
  Eigen::Vector3d instrument = Eigen::Vector3d::Zero();  // world, m
  double orientation_rad = 0;                            // as StationCost has it
  std::optional<double> height_m;                        // above the point of its name; unset: it stands on none
};

struct StationNetwork {
  std::vector<StationSetup> setups;  // those that could be placed
  std::vector<NetworkPoint> points;  // all targets and set-ups that could be placed, by name
  Eigen::MatrixXd covariance;        // of these points jointly, 3 rows each, m^2
  std::vector<NetworkResidual> residuals;
  int redundancy = 0;
  std::vector<std::string> unplaced;  // targets and set-ups that the known points do not reach
  std::vector<std::string> warnings;  // blunders, by the line of the file
};

// What was read, and its sigma: rad or m.
std::pair<double, double> ReadingOf(const StationSighting& sighting, StationReading reading);

// The tag and its corner (-1: the centre) that a target names: "tag:57", "tag:57/2". Unset: a point.
std::optional<std::pair<int, int>> TagOfTarget(const std::string& target);

// An instrument vertically above the point it stands on, centred to a millimetre: point (3), instrument (3) -> 3 (m).
class AboveCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit AboveCost(double height_m, const Rigid3d& level_from_world = {})
      : above_m_(level_from_world.rotation.conjugate() * (height_m * Eigen::Vector3d::UnitZ())) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d above_m_;  // world axes
};

// total_station.csv (docs/file_formats.md). Unusable rows are skipped and named. Throws IoError, InputError.
std::vector<StationSighting> ReadTotalStation(const std::filesystem::path& file, std::vector<std::string>* warnings);

// A level frame in the middle of the known points that a set-up stands on or has a distance to; without such, of all.
// `enu`: world's frame; its ellipsoid's normal in the middle is vertical there. Unset: world is a frame of the
// surveyor's own, and its z axis is taken for the vertical there.
Rigid3d LevelFromWorld(const std::vector<NetworkPoint>& known, const std::vector<StationSighting>& sightings,
                       const std::optional<LocalFrame>& enu);

// Least squares over set-ups, orientations and points; gauge: `known`, as well as they are known. Set-ups are placed
// from points known so far (a known point of the set-up's name is where it stands) by two of these with distances at
// least, then targets by polar readings. Readings beyond a standardised residual of 3.9 (99.99 %) are taken out one at
// a time and named. Throws InputError where no set-up can be placed.
StationNetwork AdjustNetwork(const std::vector<StationSighting>& sightings, const std::vector<NetworkPoint>& known,
                             const CancelToken& cancel, const Rigid3d& level_from_world = {});

}  // namespace trigpoint
