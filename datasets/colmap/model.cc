// Writing of sparse models; reading is in model_reader.cc.
#include "datasets/colmap/model.h"

#include <cstring>
#include <fstream>
#include <sstream>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "datasets/colmap/camera_models.h"

namespace trigpoint {
namespace {

class Output {
 public:
  explicit Output(std::filesystem::path file) : file_(std::move(file)), out_(file_, std::ios::binary) {
    out_.precision(17);
  }
  template <typename T>
  void Put(T value) {
    out_.write(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void PutName(const std::string& text) { out_.write(text.c_str(), static_cast<std::streamsize>(text.size()) + 1); }
  std::ostream& text() { return out_; }
  void Close() {
    out_.close();
    if (!out_) throw IoError(file_.string() + ": cannot be written; is the disk full?");
  }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
};

std::array<double, 7> Numbers(const Rigid3d& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
}

void WriteBinary(const SparseModel& model, const std::filesystem::path& dir) {
  Output cameras(dir / "cameras.bin");
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
  Output images(dir / "images.bin");
  images.Put<uint64_t>(model.images.size());
  for (const ModelImage& image : model.images) {
    images.Put<uint32_t>(image.id);
    for (double v : Numbers(image.cam_from_world)) images.Put<double>(v);
    images.Put<uint32_t>(image.camera_id);
    images.PutName(image.name);
    images.Put<uint64_t>(image.pixels.size());
    for (size_t k = 0; k < image.pixels.size(); ++k) {
      const Eigen::Vector2d p = ToColmapPixel(image.pixels[k]);
      images.Put<double>(p.x());
      images.Put<double>(p.y());
      images.Put<int64_t>(image.points[k]);
    }
  }
  images.Close();
  Output points(dir / "points3D.bin");
  points.Put<uint64_t>(model.points.size());
  for (const ModelPoint& point : model.points) {
    points.Put<int64_t>(point.id);
    for (int k = 0; k < 3; ++k) points.Put<double>(point.position(k));
    for (uint8_t c : point.rgb) points.Put<uint8_t>(c);
    points.Put<double>(point.error_px);
    points.Put<uint64_t>(point.track.size());
    for (const auto& [image, index] : point.track) {
      points.Put<uint32_t>(image);
      points.Put<uint32_t>(index);
    }
  }
  points.Close();
}

void WriteText(const SparseModel& model, const std::filesystem::path& dir) {
  Output cameras(dir / "cameras.txt");
  cameras.text() << "# Camera list: CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const auto& [id, camera] : model.cameras) {
    const ColmapCamera c = ToColmap(camera);
    cameras.text() << id << ' ' << c.model_name << ' ' << c.width << ' ' << c.height;
    for (double p : c.params) cameras.text() << ' ' << p;
    cameras.text() << '\n';
  }
  cameras.Close();
  Output images(dir / "images.txt");
  images.text() << "# Image list: IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ (cam_from_world), CAMERA_ID, NAME\n"
                   "#   POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (const ModelImage& image : model.images) {
    images.text() << image.id;
    for (double v : Numbers(image.cam_from_world)) images.text() << ' ' << v;
    images.text() << ' ' << image.camera_id << ' ' << image.name << '\n';
    for (size_t k = 0; k < image.pixels.size(); ++k) {
      const Eigen::Vector2d p = ToColmapPixel(image.pixels[k]);
      images.text() << (k > 0 ? " " : "") << p.x() << ' ' << p.y() << ' ' << image.points[k];
    }
    images.text() << '\n';
  }
  images.Close();
  Output points(dir / "points3D.txt");
  points.text() << "# 3D point list: POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (const ModelPoint& point : model.points) {
    points.text() << point.id;
    for (int k = 0; k < 3; ++k) points.text() << ' ' << point.position(k);
    for (uint8_t c : point.rgb) points.text() << ' ' << static_cast<int>(c);
    points.text() << ' ' << point.error_px;
    for (const auto& [image, index] : point.track) points.text() << ' ' << image << ' ' << index;
    points.text() << '\n';
  }
  points.Close();
}

}  // namespace

const Camera& SparseModel::CameraOf(const ModelImage& image) const {
  for (const auto& [id, camera] : cameras) {
    if (id == image.camera_id) return camera;
  }
  throw InputError("image " + image.name + ": its camera " + std::to_string(image.camera_id) + " is not in the model");
}

void WriteColmapModel(const SparseModel& model, const std::filesystem::path& dir, ModelFormat format) {
  std::error_code error;
  std::filesystem::create_directories(dir, error);
  if (error) throw IoError(dir.string() + ": cannot be made: " + error.message());
  format == ModelFormat::kBinary ? WriteBinary(model, dir) : WriteText(model, dir);
}

}  // namespace trigpoint
