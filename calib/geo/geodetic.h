// The Earth: geodetic, ECEF, local ENU and UTM coordinates through GeographicLib, and compass angles.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// WGS 84. Height above the ellipsoid unless a name says otherwise.
struct Geodetic {
  double latitude_deg = 0;
  double longitude_deg = 0;
  double height_m = 0;
};

// 1 sigma of a height that nobody told, m.
inline constexpr double kUnknownHeightSigma = 1e4;

// 1 sigma of a height against others of its receiver, where `sigma_sea_m` of its sigma is an error that all share, m.
inline double OwnHeightSigma(double sigma_v_m, double sigma_sea_m) {
  return std::sqrt(sigma_v_m * sigma_v_m - sigma_sea_m * sigma_sea_m);
}

Eigen::Vector3d EcefFromGeodetic(const Geodetic& g);
Geodetic GeodeticFromEcef(const Eigen::Vector3d& ecef);

// A local east-north-up frame ("world" in the site's files), metres, right-handed.
class LocalFrame {
 public:
  LocalFrame() = default;
  // Throws InputError for a latitude beyond +-90 deg, a longitude beyond +-540 deg or a non-finite value.
  explicit LocalFrame(const Geodetic& origin);
  const Geodetic& origin() const { return origin_; }
  Eigen::Vector3d EnuFromGeodetic(const Geodetic& g) const;
  Geodetic GeodeticFromEnu(const Eigen::Vector3d& enu) const;
  // Rotation ecef_from_enu.
  Eigen::Matrix3d EcefFromEnuRotation() const;

 private:
  Geodetic origin_;
};

struct Utm {
  int zone = 0;  // 1..60
  bool north = true;
  double easting_m = 0;
  double northing_m = 0;
  int EpsgCode() const { return (north ? 32600 : 32700) + zone; }
};

// zone 0: the standard zone of the longitude.
Utm UtmFromGeodetic(const Geodetic& g, int zone = 0);
Geodetic GeodeticFromUtm(const Utm& utm, double height_m);

// Attitude of a camera-like frame (x right, y down, z forward): heading of its optical axis clockwise from
// north, pitch of the axis above the horizon, roll clockwise seen from behind the camera (rad).
struct Attitude {
  double heading_rad = 0;
  double pitch_rad = 0;
  double roll_rad = 0;
};

// The one place where compass angles become rotations: world (ENU) from camera.
Eigen::Quaterniond WorldFromCamRotation(const Attitude& attitude);
// Inverse; at pitch = +-90 deg the roll is set to zero. heading in [0, 2 pi).
Attitude AttitudeOf(const Eigen::Quaterniond& world_from_cam);

// Covariance (rad^2, world axes: the left tangent of world_from_cam) of independent heading, pitch, roll errors.
Eigen::Matrix3d AttitudeCovariance(const Attitude& attitude, double sigma_heading_rad, double sigma_pitch_rad,
                                   double sigma_roll_rad);
// d(heading, pitch, roll) / d(left tangent of world_from_cam), 3 x 3.
Eigen::Matrix3d AttitudeJacobian(const Eigen::Quaterniond& world_from_cam);

// Wraps an angle to (-pi, pi].
double WrapAngle(double angle_rad);

constexpr double kDegToRad = 3.14159265358979323846 / 180.0;
constexpr double kRadToDeg = 180.0 / 3.14159265358979323846;

}  // namespace trigpoint
