#include "calib/geo/geodetic.h"

#include <Eigen/LU>
#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/UTMUPS.hpp>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

void Check(const Geodetic& g) {
  if (!std::isfinite(g.latitude_deg) || !std::isfinite(g.longitude_deg) || !std::isfinite(g.height_m) ||
      std::abs(g.latitude_deg) > 90 || std::abs(g.longitude_deg) > 540) {
    throw InputError("geodetic position " + std::to_string(g.latitude_deg) + ", " + std::to_string(g.longitude_deg) +
                     ", " + std::to_string(g.height_m) +
                     " is not on the Earth: expected latitude -90 to 90 deg, longitude -180 to 180 deg");
  }
}

// Columns: the world axes about which each angle turns the camera.
Eigen::Matrix3d AnglesAxes(const Attitude& a, const Eigen::Quaterniond& world_from_cam) {
  Eigen::Matrix3d axes;
  axes.col(0) = -Eigen::Vector3d::UnitZ();  // heading grows clockwise seen from above
  axes.col(1) = Eigen::Vector3d(std::cos(a.heading_rad), -std::sin(a.heading_rad), 0);
  axes.col(2) = world_from_cam * Eigen::Vector3d::UnitZ();
  return axes;
}

}  // namespace

Eigen::Vector3d EcefFromGeodetic(const Geodetic& g) {
  Check(g);
  Eigen::Vector3d p;
  GeographicLib::Geocentric::WGS84().Forward(g.latitude_deg, g.longitude_deg, g.height_m, p.x(), p.y(), p.z());
  return p;
}

Geodetic GeodeticFromEcef(const Eigen::Vector3d& ecef) {
  Geodetic g;
  GeographicLib::Geocentric::WGS84().Reverse(ecef.x(), ecef.y(), ecef.z(), g.latitude_deg, g.longitude_deg, g.height_m);
  return g;
}

LocalFrame::LocalFrame(const Geodetic& origin) : origin_(origin) { Check(origin); }

Eigen::Vector3d LocalFrame::EnuFromGeodetic(const Geodetic& g) const {
  Check(g);
  const GeographicLib::LocalCartesian local(origin_.latitude_deg, origin_.longitude_deg, origin_.height_m);
  Eigen::Vector3d p;
  local.Forward(g.latitude_deg, g.longitude_deg, g.height_m, p.x(), p.y(), p.z());
  return p;
}

Geodetic LocalFrame::GeodeticFromEnu(const Eigen::Vector3d& enu) const {
  const GeographicLib::LocalCartesian local(origin_.latitude_deg, origin_.longitude_deg, origin_.height_m);
  Geodetic g;
  local.Reverse(enu.x(), enu.y(), enu.z(), g.latitude_deg, g.longitude_deg, g.height_m);
  return g;
}

Eigen::Matrix3d LocalFrame::EcefFromEnuRotation() const {
  const double lat = origin_.latitude_deg * kDegToRad, lon = origin_.longitude_deg * kDegToRad;
  const double sl = std::sin(lat), cl = std::cos(lat), so = std::sin(lon), co = std::cos(lon);
  Eigen::Matrix3d r;
  r << -so, -sl * co, cl * co, co, -sl * so, cl * so, 0, cl, sl;
  return r;
}

Utm UtmFromGeodetic(const Geodetic& g, int zone) {
  Check(g);
  Utm utm;
  try {
    GeographicLib::UTMUPS::Forward(g.latitude_deg, g.longitude_deg, utm.zone, utm.north, utm.easting_m, utm.northing_m,
                                   zone == 0 ? static_cast<int>(GeographicLib::UTMUPS::UTM) : zone);
  } catch (const GeographicLib::GeographicErr& e) {
    throw InputError(std::string("no UTM coordinates: ") + e.what());
  }
  return utm;
}

Geodetic GeodeticFromUtm(const Utm& utm, double height_m) {
  Geodetic g;
  g.height_m = height_m;
  try {
    GeographicLib::UTMUPS::Reverse(utm.zone, utm.north, utm.easting_m, utm.northing_m, g.latitude_deg, g.longitude_deg);
  } catch (const GeographicLib::GeographicErr& e) {
    throw InputError(std::string("not a UTM position: ") + e.what());
  }
  return g;
}

Eigen::Quaterniond WorldFromCamRotation(const Attitude& a) {
  const double sh = std::sin(a.heading_rad), ch = std::cos(a.heading_rad);
  // Level camera looking along the heading: columns right, down, forward in ENU.
  Eigen::Matrix3d level;
  level << ch, 0, sh, -sh, 0, ch, 0, -1, 0;
  // Pitch up: about the camera's +x axis (y down, so a positive turn about x raises z). Roll clockwise: about +z.
  const Eigen::Quaterniond q = Eigen::Quaterniond(level) * Eigen::AngleAxisd(a.pitch_rad, Eigen::Vector3d::UnitX()) *
                               Eigen::AngleAxisd(a.roll_rad, Eigen::Vector3d::UnitZ());
  return q.normalized();
}

Attitude AttitudeOf(const Eigen::Quaterniond& world_from_cam) {
  const Eigen::Matrix3d r = world_from_cam.toRotationMatrix();
  const Eigen::Vector3d right = r.col(0), forward = r.col(2);
  Attitude a;
  const double horizontal = std::hypot(forward.x(), forward.y());
  a.pitch_rad = std::atan2(forward.z(), horizontal);
  if (horizontal < 1e-9) {
    a.heading_rad = std::atan2(-right.y(), right.x());
  } else {
    a.heading_rad = std::atan2(forward.x(), forward.y());
    const double sh = std::sin(a.heading_rad), ch = std::cos(a.heading_rad);
    const Eigen::Vector3d level_right(ch, -sh, 0);
    const Eigen::Vector3d level_down = forward.cross(level_right);
    a.roll_rad = std::atan2(right.dot(level_down), right.dot(level_right));
  }
  if (a.heading_rad < 0) a.heading_rad += 2 * M_PI;
  return a;
}

Eigen::Matrix3d AttitudeJacobian(const Eigen::Quaterniond& world_from_cam) {
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(AnglesAxes(AttitudeOf(world_from_cam), world_from_cam));
  if (!lu.isInvertible()) throw NumericError("heading is undefined: the camera looks straight up or down");
  return lu.inverse();
}

Eigen::Matrix3d AttitudeCovariance(const Attitude& a, double sigma_heading_rad, double sigma_pitch_rad,
                                   double sigma_roll_rad) {
  const Eigen::Matrix3d axes = AnglesAxes(a, WorldFromCamRotation(a));
  const Eigen::Vector3d variance(sigma_heading_rad * sigma_heading_rad, sigma_pitch_rad * sigma_pitch_rad,
                                 sigma_roll_rad * sigma_roll_rad);
  return axes * variance.asDiagonal() * axes.transpose();
}

double WrapAngle(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2 * M_PI);
  return wrapped <= -M_PI ? wrapped + 2 * M_PI : wrapped;
}

}  // namespace trigpoint
