// A sparse model in COLMAP's binary format.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct ModelImage {
  uint32_t id = 0;
  std::string name;
  uint32_t camera_id = 0;
  Rigid3d cam_from_world;
  std::vector<Eigen::Vector2d> pixels;  // ours
  std::vector<int64_t> points;          // point id of each pixel, -1: none
};

struct ModelPoint {
  int64_t id = 0;
  Eigen::Vector3d position;
  double error_px = 0;
  std::vector<std::pair<uint32_t, uint32_t>> track;  // (image id, index of its pixel)
};

struct SparseModel {
  std::vector<std::pair<uint32_t, Camera>> cameras;
  std::vector<ModelImage> images;
  std::vector<ModelPoint> points;
};

// cameras.bin, images.bin, points3D.bin. Throws IoError.
void WriteColmapModel(const SparseModel& model, const std::filesystem::path& dir);

}  // namespace trigpoint
