#include "datasets/colmap/camera_models.h"

#include "calib/base/error.h"

namespace trigpoint {

ColmapCamera ToColmap(const Camera& camera) {
  ColmapCamera c;
  c.width = camera.width(), c.height = camera.height();
  const std::vector<double>& p = camera.params();
  switch (camera.model()) {
    case CameraModel::kPinhole: c.params = p; break;
    case CameraModel::kRadtan:
      if (p.size() == 9 && p[8] != 0) {
        c.model_id = 6, c.model_name = "FULL_OPENCV";
        c.params = p;
        c.params.resize(12, 0.0);
      } else {
        c.model_id = 4, c.model_name = "OPENCV";
        c.params.assign(p.begin(), p.begin() + 8);
      }
      break;
    case CameraModel::kRational: c.model_id = 6, c.model_name = "FULL_OPENCV", c.params = p; break;
    case CameraModel::kKannalaBrandt: c.model_id = 5, c.model_name = "OPENCV_FISHEYE", c.params = p; break;
    case CameraModel::kEquirectangular: throw InputError("COLMAP has no equirectangular camera");
  }
  c.params[2] += 0.5, c.params[3] += 0.5;
  return c;
}

namespace {

// All of COLMAP 3.x and 4.x: the number of parameters says where the next camera begins.
constexpr ColmapModelInfo kModels[] = {{0, "SIMPLE_PINHOLE", 3, true},
                                       {1, "PINHOLE", 4, true},
                                       {2, "SIMPLE_RADIAL", 4, true},
                                       {3, "RADIAL", 5, true},
                                       {4, "OPENCV", 8, true},
                                       {5, "OPENCV_FISHEYE", 8, true},
                                       {6, "FULL_OPENCV", 12, true},
                                       {7, "FOV", 5, false},
                                       {8, "SIMPLE_RADIAL_FISHEYE", 4, true},
                                       {9, "RADIAL_FISHEYE", 5, true},
                                       {10, "THIN_PRISM_FISHEYE", 12, false},
                                       {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16, false},
                                       {12, "SIMPLE_DIVISION", 4, false},
                                       {13, "DIVISION", 5, false},
                                       {14, "SIMPLE_FISHEYE", 3, true},
                                       {15, "FISHEYE", 4, true},
                                       {16, "EUCM", 6, false}};

}  // namespace

const ColmapModelInfo* FindColmapModel(int id) {
  for (const ColmapModelInfo& info : kModels) {
    if (info.id == id) return &info;
  }
  return nullptr;
}

const ColmapModelInfo* FindColmapModel(std::string_view name) {
  for (const ColmapModelInfo& info : kModels) {
    if (name == info.name) return &info;
  }
  return nullptr;
}

Camera FromColmap(const ColmapCamera& c) {
  const ColmapModelInfo* known = FindColmapModel(c.model_id);
  if (known == nullptr || !known->supported) {
    throw InputError("COLMAP camera model " + (known != nullptr ? std::string(known->name) : c.model_name) + " (id " +
                     std::to_string(c.model_id) +
                     ") is not supported; undistort the images or convert it to OPENCV or OPENCV_FISHEYE");
  }
  const std::vector<double>& p = c.params;
  if (p.size() != known->params) {
    throw InputError(std::string("COLMAP camera ") + known->name + ": expected " + std::to_string(known->params) +
                     " parameters, found " + std::to_string(p.size()));
  }
  const auto make = [&](CameraModel model, std::vector<double> q) {
    q[2] -= 0.5, q[3] -= 0.5;
    return Camera(model, c.width, c.height, std::move(q));
  };
  switch (c.model_id) {
    case 0: return make(CameraModel::kPinhole, {p[0], p[0], p[1], p[2]});
    case 1: return make(CameraModel::kPinhole, p);
    case 2: return make(CameraModel::kRadtan, {p[0], p[0], p[1], p[2], p[3], 0, 0, 0});
    case 3: return make(CameraModel::kRadtan, {p[0], p[0], p[1], p[2], p[3], p[4], 0, 0});
    case 4: return make(CameraModel::kRadtan, p);
    case 5: return make(CameraModel::kKannalaBrandt, p);
    case 6: return make(CameraModel::kRational, p);
    case 14: return make(CameraModel::kKannalaBrandt, {p[0], p[0], p[1], p[2], 0, 0, 0, 0});
    case 15: return make(CameraModel::kKannalaBrandt, {p[0], p[1], p[2], p[3], 0, 0, 0, 0});
    case 8: return make(CameraModel::kKannalaBrandt, {p[0], p[0], p[1], p[2], p[3], 0, 0, 0});
    default: return make(CameraModel::kKannalaBrandt, {p[0], p[0], p[1], p[2], p[3], p[4], 0, 0});
  }
}

}  // namespace trigpoint
