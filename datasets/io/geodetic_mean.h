// The middle of positions.
#pragma once

#include <cmath>

#include "calib/geo/geodetic.h"

namespace trigpoint {

// Mean on the ellipsoid, also across the 180th meridian, where the mean of the longitudes is on the other side of the
// Earth; height: the mean of those that are known, 0 without one.
class GeodeticMean {
 public:
  void Add(const Geodetic& g, bool has_height) {
    ecef_ += EcefFromGeodetic({g.latitude_deg, g.longitude_deg, 0});
    ++count_;
    if (!has_height || !std::isfinite(g.height_m)) return;
    height_ += g.height_m;
    ++heights_;
  }
  int count() const { return count_; }
  int heights() const { return heights_; }
  Geodetic Mean() const {
    Geodetic mean = GeodeticFromEcef(ecef_ / count_);
    mean.height_m = heights_ > 0 ? height_ / heights_ : 0;
    return mean;
  }

 private:
  Eigen::Vector3d ecef_ = Eigen::Vector3d::Zero();
  double height_ = 0;
  int count_ = 0;
  int heights_ = 0;
};

}  // namespace trigpoint
