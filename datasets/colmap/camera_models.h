// COLMAP's camera models and ours.
#pragma once

#include <string>
#include <vector>

#include "calib/camera/camera.h"

namespace trigpoint {

struct ColmapCamera {
  int model_id = 1;  // 1 PINHOLE, 4 OPENCV, 5 OPENCV_FISHEYE, 6 FULL_OPENCV, ...
  std::string model_name = "PINHOLE";
  int width = 0, height = 0;
  std::vector<double> params;  // principal point in COLMAP's pixels
};

// Throws InputError for a model that COLMAP does not have (equirectangular).
ColmapCamera ToColmap(const Camera& camera);
// SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV, SIMPLE_RADIAL_FISHEYE,
// RADIAL_FISHEYE; throws InputError naming any other model.
Camera FromColmap(const ColmapCamera& camera);

}  // namespace trigpoint
