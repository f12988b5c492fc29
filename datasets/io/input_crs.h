// Positions in the coordinate reference system that somebody has them in, to WGS 84.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "calib/geo/geodetic.h"

namespace trigpoint {

class InputCrs {
 public:
  // An EPSG code ("EPSG:2056"; two of them, "EPSG:25832+5783"; "2056"), a PROJ string, a WKT, or a name that PROJ
  // knows. WGS 84, UTM on it (EPSG:326zz, 327zz) and on ETRS89 (EPSG:258zz, taken as WGS 84: less than a metre apart)
  // are built in. Throws InputError for what is no system, or needs PROJ where it is not built in.
  static InputCrs Named(const std::string& text);
  ~InputCrs();
  InputCrs(InputCrs&&) noexcept;
  InputCrs(const InputCrs&) = delete;

  // x, y: longitude, latitude or easting, northing, whatever the order of the system's axes, in its own units. z: in
  // the unit of the vertical axis if it has one, else metres above the ellipsoid of WGS 84. Throws InputError where
  // there is no transformation: a grid that is not installed is named, and how to get it.
  Geodetic ToWgs84(double x, double y, double z) const;

  const std::string& name() const { return name_; }
  bool geographic() const { return geographic_; }
  bool has_vertical() const { return has_vertical_; }
  double unit_m() const { return unit_m_; }                // of x and y, if not geographic
  double height_unit_m() const { return height_unit_m_; }  // of z
  // What the transformation used last is good to, m; unset: exact, or not known.
  std::optional<double> accuracy_m() const { return accuracy_m_; }
  // Set if the system names no datum and its ellipsoid is that of WGS 84 or GRS 80: it is taken as WGS 84.
  bool datum_assumed() const { return datum_assumed_; }

 private:
  struct Proj;
  InputCrs();
  std::string text_, name_;
  int utm_zone_ = 0;  // negative: south; 0: not a built-in UTM
  bool geographic_ = true, has_vertical_ = false;
  double unit_m_ = 1, height_unit_m_ = 1;
  mutable std::optional<double> accuracy_m_;
  mutable bool datum_assumed_ = false;
  std::unique_ptr<Proj> proj_;
};

// Metres of a length's unit: "m", "ft", "us-ft"; nothing for another name.
std::optional<double> LengthUnit(const std::string& name);

}  // namespace trigpoint
