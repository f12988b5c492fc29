// Inverse distance in every direction from the rig's centre, smooth, from the points whose distance is known.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "survey/panorama/rig_bundle.h"

namespace trigpoint {

class DistanceField {
 public:
  // Far everywhere.
  DistanceField() = default;
  explicit DistanceField(const RigState& state);
  // 1/m, in the direction of azimuth (from z towards x) and elevation (towards -y), rad.
  double InverseDistance(double azimuth, double elevation) const;

 private:
  cv::Mat grid_;  // CV_32F, equirectangular
};

}  // namespace trigpoint
