// Coordinate reference systems by EPSG code, to write positions in.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "calib/geo/geodetic.h"
#include "datasets/io/height_system.h"

namespace trigpoint {

// A horizontal system that positions are written in. WGS 84 (EPSG:4326) and UTM on WGS 84 (EPSG:326zz, 327zz) are
// built in; every other code needs PROJ (built with it where it was installed). Axis order is always x, y: longitude,
// latitude or easting, northing.
class Crs {
 public:
  // "EPSG:25832"; "" or "EPSG:4326" is WGS 84; "utm" the zone of `near`. Throws OptionError for what is unknown, has
  // three axes, or needs PROJ when it isn't there.
  static Crs Named(const std::string& code, const Geodetic& near);
  ~Crs();
  Crs(Crs&&) noexcept;
  Crs(const Crs&) = delete;

  // x, y: degrees if geographic, else the system's unit (metres but for a few). Throws InputError where the position
  // has none.
  Eigen::Vector2d FromGeodetic(const Geodetic& g) const;

  int epsg() const { return epsg_; }
  const std::string& name() const { return name_; }  // "WGS 84 / UTM zone 32N"
  bool geographic() const { return geographic_; }
  const std::string& wkt() const { return wkt_; }  // OGC WKT 1
  // What the best known transformation from WGS 84 is good to at `near`, m; unset: exact, or not known.
  std::optional<double> accuracy_m() const { return accuracy_m_; }

 private:
  struct Proj;
  Crs();
  // A system that is not built in, by PROJ.
  void OpenProj(const std::string& code, const Geodetic& near);
  void ChooseTransform(const std::string& code, const Geodetic& near);
  int epsg_ = 4326;
  int utm_zone_ = 0;  // negative: south; 0: not a built-in UTM
  std::string name_, wkt_;
  bool geographic_ = true;
  std::optional<double> accuracy_m_;
  std::unique_ptr<Proj> proj_;
};

}  // namespace trigpoint
