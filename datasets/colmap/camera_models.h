// COLMAP's camera models and ours.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "calib/camera/camera.h"

namespace trigpoint {

struct ColmapCamera {
  int model_id = 1;  // 1 PINHOLE, 4 OPENCV, 5 OPENCV_FISHEYE, 6 FULL_OPENCV, ...
  std::string model_name = "PINHOLE";
  int width = 0, height = 0;
  std::vector<double> params;  // principal point in COLMAP's pixels
};

// A camera model of COLMAP 3.x or 4.x; `supported`: one of ours can represent it.
struct ColmapModelInfo {
  int id;
  const char* name;
  size_t params;
  bool supported;
};
// Null for an unknown one.
const ColmapModelInfo* FindColmapModel(int id);
const ColmapModelInfo* FindColmapModel(std::string_view name);

// Throws InputError for a model that COLMAP does not have (equirectangular).
ColmapCamera ToColmap(const Camera& camera);
// SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV, SIMPLE_RADIAL_FISHEYE,
// RADIAL_FISHEYE, SIMPLE_FISHEYE, FISHEYE; throws InputError naming any other model.
Camera FromColmap(const ColmapCamera& camera);

}  // namespace trigpoint
