// A sparse model, and COLMAP's formats of it: binary and text, of 3.x and of 4.x with rigs and frames.
//
// Pixels are ours on this side; COLMAP's +0.5 is applied inside. Frames: `world` is the model's own.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
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
  std::array<uint8_t, 3> rgb = {160, 160, 160};
  std::vector<std::pair<uint32_t, uint32_t>> track;  // (image id, index of its pixel)
};

// Cameras that move together (COLMAP 4): the first is the reference, its pose the identity.
struct ModelRig {
  uint32_t id = 0;
  std::vector<std::pair<uint32_t, Rigid3d>> cameras;  // camera id, cam_from_rig
};

// One moment of a rig.
struct ModelFrame {
  uint32_t id = 0;
  uint32_t rig = 0;
  Rigid3d rig_from_world;
  std::vector<uint32_t> images;
};

struct SparseModel {
  std::vector<std::pair<uint32_t, Camera>> cameras;
  std::vector<ModelImage> images;
  std::vector<ModelPoint> points;
  std::vector<ModelRig> rigs;      // of COLMAP 4, else empty
  std::vector<ModelFrame> frames;  // likewise

  // Throws InputError naming the id if there is none.
  const Camera& CameraOf(const ModelImage& image) const;
};

enum class ModelFormat { kBinary, kText };

// cameras, images, points3D (.bin or .txt), as COLMAP 3.x and 4.x read them. Makes the folder. Throws IoError.
void WriteColmapModel(const SparseModel& model, const std::filesystem::path& dir,
                      ModelFormat format = ModelFormat::kBinary);

// Reads DIR/{cameras,images,points3D}.{bin,txt}, binary first, and rigs and frames where they are. Everything is
// checked: counts against the file's size, ids against each other, numbers for being finite. Throws InputError with one
// sentence naming the file, the id or line, what was expected and what was found.
SparseModel ReadColmapModel(const std::filesystem::path& dir);
// Is there one?
bool HasColmapModel(const std::filesystem::path& dir);

// The files' contents, by name without folder ("cameras.bin", ...), for ReadColmapModel and its tests.
SparseModel ParseColmapModel(const std::map<std::string, std::string>& files, const std::string& where);

}  // namespace trigpoint
