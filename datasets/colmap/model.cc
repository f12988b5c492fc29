#include "datasets/colmap/model.h"

#include <cstring>
#include <fstream>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "datasets/colmap/camera_models.h"

namespace trigpoint {
namespace {

class BinaryWriter {
 public:
  explicit BinaryWriter(const std::filesystem::path& file) : file_(file), out_(file, std::ios::binary) {}
  template <typename T>
  void Put(T value) {
    out_.write(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void PutText(const std::string& text) { out_.write(text.c_str(), static_cast<std::streamsize>(text.size()) + 1); }
  void Close() {
    out_.close();
    if (!out_) throw IoError(file_.string() + ": cannot be written; is the disk full?");
  }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
};

}  // namespace

void WriteColmapModel(const SparseModel& model, const std::filesystem::path& dir) {
  std::filesystem::create_directories(dir);
  BinaryWriter cameras(dir / "cameras.bin");
  cameras.Put<uint64_t>(model.cameras.size());
  for (const auto& [id, camera] : model.cameras) {
    const ColmapCamera c = ToColmap(camera);
    cameras.Put<uint32_t>(id);
    cameras.Put<int32_t>(c.model_id);
    cameras.Put<uint64_t>(static_cast<uint64_t>(c.width));
    cameras.Put<uint64_t>(static_cast<uint64_t>(c.height));
    for (double p : c.params) cameras.Put<double>(p);
  }
  cameras.Close();
  BinaryWriter images(dir / "images.bin");
  images.Put<uint64_t>(model.images.size());
  for (const ModelImage& image : model.images) {
    images.Put<uint32_t>(image.id);
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (double v : {q.w(), q.x(), q.y(), q.z()}) images.Put<double>(v);
    for (int k = 0; k < 3; ++k) images.Put<double>(image.cam_from_world.translation(k));
    images.Put<uint32_t>(image.camera_id);
    images.PutText(image.name);
    images.Put<uint64_t>(image.pixels.size());
    for (size_t k = 0; k < image.pixels.size(); ++k) {
      const Eigen::Vector2d p = ToColmapPixel(image.pixels[k]);
      images.Put<double>(p.x());
      images.Put<double>(p.y());
      images.Put<int64_t>(image.points[k]);
    }
  }
  images.Close();
  BinaryWriter points(dir / "points3D.bin");
  points.Put<uint64_t>(model.points.size());
  for (const ModelPoint& point : model.points) {
    points.Put<int64_t>(point.id);
    for (int k = 0; k < 3; ++k) points.Put<double>(point.position(k));
    for (int k = 0; k < 3; ++k) points.Put<uint8_t>(160);  // no colour is kept
    points.Put<double>(point.error_px);
    points.Put<uint64_t>(point.track.size());
    for (const auto& [image, index] : point.track) {
      points.Put<uint32_t>(image);
      points.Put<uint32_t>(index);
    }
  }
  points.Close();
}

}  // namespace trigpoint
