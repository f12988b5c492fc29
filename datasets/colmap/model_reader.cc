// Reading of sparse models. The input is hostile: no count, id or number is used before it is checked.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "datasets/colmap/camera_models.h"
#include "datasets/colmap/model.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// The largest picture side and the farthest number taken for real: keeps arithmetic finite.
constexpr uint64_t kMaxSide = 1'000'000;
constexpr double kMaxNumber = 1e15;

// What both formats share: values are asked for in the files' order.
class Source {
 public:
  explicit Source(std::string file) : file_(std::move(file)) {}
  virtual ~Source() = default;
  [[noreturn]] void Fail(const std::string& what) const { throw InputError(Where() + what); }
  Eigen::Vector3d Vector() { return {Real(), Real(), Real()}; }
  double Real() {
    const double v = RawReal();
    if (!(std::abs(v) < kMaxNumber)) Fail("expected a finite number, found " + fmt::format("{}", v));
    return v;
  }
  uint32_t Id(const char* what) {
    const int64_t v = Integer();
    if (v < 0 || v >= std::numeric_limits<uint32_t>::max()) Fail(fmt::format("{} {} is no id", what, v));
    return static_cast<uint32_t>(v);
  }
  Rigid3d Pose() {
    const double w = Real(), x = Real(), y = Real(), z = Real();
    const Eigen::Quaterniond q(w, x, y, z);
    const Eigen::Vector3d t = Vector();
    if (!(q.norm() > 1e-6)) Fail("the rotation is no quaternion: all of qw qx qy qz are 0");
    return {q, t};
  }

 protected:
  virtual std::string Where() const = 0;
  virtual double RawReal() = 0;
  virtual int64_t Integer() = 0;
  std::string file_;
};

class Bytes final : public Source {
 public:
  Bytes(std::string file, std::string_view bytes) : Source(std::move(file)), bytes_(bytes) {}
  template <typename T>
  T Get() {
    if (bytes_.size() - at_ < sizeof(T)) {
      Fail(fmt::format("it ends at byte {} in the middle of an entry; it is cut off, copy it again", bytes_.size()));
    }
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  // A count of entries of at least `bytes` each.
  size_t Count(uint64_t n, size_t bytes, const char* what) {
    if (n > (bytes_.size() - at_) / bytes) {
      Fail(fmt::format("expected {} {}, but only {} bytes are left; it is cut off or damaged", n, what,
                       bytes_.size() - at_));
    }
    return static_cast<size_t>(n);
  }
  std::string Name() {
    const size_t end = bytes_.find('\0', at_);
    if (end == std::string_view::npos) Fail("an image's name has no end; it is cut off, copy it again");
    const std::string name(bytes_.substr(at_, end - at_));
    at_ = end + 1;
    return name;
  }
  void ExpectEnd() const {
    if (at_ != bytes_.size()) Fail(fmt::format("{} bytes too many after the last entry", bytes_.size() - at_));
  }

 private:
  std::string Where() const override { return fmt::format("{}: ", file_); }
  double RawReal() override { return Get<double>(); }
  int64_t Integer() override { return Get<uint32_t>(); }
  std::string_view bytes_;
  size_t at_ = 0;
};

class Lines final : public Source {
 public:
  Lines(std::string file, std::string_view text) : Source(std::move(file)), rest_(text) {}
  // The next line that is no comment; empty ones only if asked for.
  bool Next(bool may_be_empty) {
    while (!rest_.empty()) {
      const size_t end = std::min(rest_.find('\n'), rest_.size());
      const std::string_view text = Trim(rest_.substr(0, end));
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      ++line_;
      if (!text.empty() && text.front() == '#') continue;
      if (text.empty() && !may_be_empty) continue;
      fields_ = SplitFields(text);
      at_ = 0;
      return true;
    }
    fields_.clear();
    at_ = 0;
    return false;
  }
  size_t Left() const { return fields_.size() - at_; }
  std::string_view Field() {
    if (at_ >= fields_.size()) Fail("the line is too short");
    return fields_[at_++];
  }
  // What is left of the line, e.g. a name with spaces.
  std::string Rest() {
    const std::string_view first = Field();
    const std::string_view last = fields_.back();
    at_ = fields_.size();
    return {first.data(), static_cast<size_t>(last.data() + last.size() - first.data())};
  }
  int64_t Integer() override {
    const std::string_view field = Field();
    const auto v = ParseInt(field);
    if (!v) Fail("expected a whole number, found '" + std::string(field) + "'");
    return *v;
  }

 private:
  std::string Where() const override { return fmt::format("{}:{}: ", file_, line_); }
  double RawReal() override {
    const std::string_view field = Field();
    const auto v = ParseDouble(field);
    if (!v) Fail("expected a number, found '" + std::string(field) + "'");
    return *v;
  }
  std::string_view rest_;
  std::vector<std::string_view> fields_;
  size_t at_ = 0;
  int line_ = 0;
};

// A sensor of a rig or an image of a frame; only cameras are kept.
constexpr int kCameraSensor = 0;

int SensorType(Lines& in) {
  const std::string_view name = in.Field();
  if (name == "CAMERA") return kCameraSensor;
  if (name == "IMU") return 1;
  in.Fail("unknown sensor '" + std::string(name) + "', expected CAMERA or IMU");
}
int SensorType(Bytes& in) { return in.Get<int32_t>(); }

void AddCamera(Source& in, uint32_t id, const ColmapModelInfo* model, const std::string& name, uint64_t width,
               uint64_t height, std::vector<double> params, SparseModel& out) {
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    in.Fail(fmt::format("camera {}: its size is {} x {} px", id, width, height));
  }
  try {
    out.cameras.emplace_back(
        id, FromColmap({model->id, name, static_cast<int>(width), static_cast<int>(height), std::move(params)}));
  } catch (const Error& e) {
    in.Fail(fmt::format("camera {}: {}", id, e.what()));
  }
}

[[noreturn]] void FailUnknownModel(Source& in, uint32_t id, const std::string& name) {
  in.Fail(
      fmt::format("camera {}: unknown camera model {}; expected one of COLMAP's, e.g. PINHOLE or OPENCV", id, name));
}

void ReadCameras(Bytes in, SparseModel& out) {
  const size_t n = in.Count(in.Get<uint64_t>(), 48, "cameras");
  for (size_t i = 0; i < n; ++i) {
    const uint32_t id = in.Id("camera");
    const int32_t model_id = in.Get<int32_t>();
    const ColmapModelInfo* model = FindColmapModel(model_id);
    if (model == nullptr) FailUnknownModel(in, id, std::to_string(model_id));
    const uint64_t width = in.Get<uint64_t>(), height = in.Get<uint64_t>();
    std::vector<double> params;
    for (size_t k = 0; k < model->params; ++k) params.push_back(in.Real());
    AddCamera(in, id, model, model->name, width, height, std::move(params), out);
  }
  in.ExpectEnd();
}

void ReadCameras(Lines in, SparseModel& out) {
  while (in.Next(false)) {
    const uint32_t id = in.Id("camera");
    const std::string name(in.Field());
    const ColmapModelInfo* model = FindColmapModel(name);
    if (model == nullptr) FailUnknownModel(in, id, name);
    const int64_t width = in.Integer(), height = in.Integer();
    std::vector<double> params;
    while (in.Left() > 0) params.push_back(in.Real());
    AddCamera(in, id, model, name, static_cast<uint64_t>(std::max<int64_t>(0, width)),
              static_cast<uint64_t>(std::max<int64_t>(0, height)), std::move(params), out);
  }
}

void ReadImages(Bytes in, SparseModel& out) {
  const size_t n = in.Count(in.Get<uint64_t>(), 73, "images");
  for (size_t i = 0; i < n; ++i) {
    ModelImage image;
    image.id = in.Id("image");
    image.cam_from_world = in.Pose();
    image.camera_id = in.Id("camera");
    image.name = in.Name();
    const size_t pixels = in.Count(in.Get<uint64_t>(), 24, "points of an image");
    image.pixels.reserve(pixels);
    image.points.reserve(pixels);
    for (size_t k = 0; k < pixels; ++k) {
      const double x = in.Real(), y = in.Real();
      image.pixels.push_back(FromColmapPixel({x, y}));
      image.points.push_back(in.Get<int64_t>());
    }
    out.images.push_back(std::move(image));
  }
  in.ExpectEnd();
}

void ReadImages(Lines in, SparseModel& out) {
  while (in.Next(false)) {
    ModelImage image;
    image.id = in.Id("image");
    image.cam_from_world = in.Pose();
    image.camera_id = in.Id("camera");
    image.name = in.Rest();
    if (in.Next(true)) {
      if (in.Left() % 3 != 0) in.Fail(fmt::format("expected x y point triples, found {} fields", in.Left()));
      while (in.Left() > 0) {
        const double x = in.Real(), y = in.Real();
        image.pixels.push_back(FromColmapPixel({x, y}));
        image.points.push_back(in.Integer());
      }
    }
    out.images.push_back(std::move(image));
  }
}

void ReadPoints(Bytes in, SparseModel& out) {
  const size_t n = in.Count(in.Get<uint64_t>(), 51, "points");
  out.points.reserve(n);
  for (size_t i = 0; i < n; ++i) {
    ModelPoint point;
    point.id = in.Get<int64_t>();
    point.position = in.Vector();
    for (uint8_t& c : point.rgb) c = in.Get<uint8_t>();
    point.error_px = in.Get<double>();
    const size_t track = in.Count(in.Get<uint64_t>(), 8, "track elements");
    point.track.reserve(track);
    for (size_t k = 0; k < track; ++k) {
      const uint32_t image = in.Get<uint32_t>();
      point.track.emplace_back(image, in.Get<uint32_t>());
    }
    out.points.push_back(std::move(point));
  }
  in.ExpectEnd();
}

void ReadPoints(Lines in, SparseModel& out) {
  while (in.Next(false)) {
    ModelPoint point;
    point.id = in.Integer();
    point.position = in.Vector();
    for (uint8_t& c : point.rgb) c = static_cast<uint8_t>(std::clamp<int64_t>(in.Integer(), 0, 255));
    point.error_px = in.Real();
    if (in.Left() % 2 != 0) in.Fail("the track is no list of image and index pairs");
    while (in.Left() > 0) {
      const uint32_t image = in.Id("image");
      point.track.emplace_back(image, in.Id("index"));
    }
    out.points.push_back(std::move(point));
  }
}

// One rig; `sensors` as the file counts them.
template <typename Input>
void ReadRig(Input& in, size_t sensors, uint32_t id, const std::function<bool()>& has_pose, SparseModel& out) {
  ModelRig rig;
  rig.id = id;
  for (size_t k = 0; k < sensors; ++k) {
    const int type = SensorType(in);
    const uint32_t sensor = in.Id("sensor");
    const bool posed = k > 0 && has_pose();
    const Rigid3d sensor_from_rig = posed ? in.Pose() : Rigid3d();
    if (type != kCameraSensor) continue;
    if (k > 0 && !posed) in.Fail(fmt::format("rig {}: its camera {} has no pose; calibrate the rig first", id, sensor));
    rig.cameras.emplace_back(sensor, sensor_from_rig);
  }
  out.rigs.push_back(std::move(rig));
}

void ReadRigs(Bytes in, SparseModel& out) {
  const size_t n = in.Count(in.Get<uint64_t>(), 8, "rigs");
  for (size_t i = 0; i < n; ++i) {
    const uint32_t id = in.Id("rig");
    const size_t sensors = in.Count(in.Get<uint32_t>(), 8, "sensors");
    ReadRig(
        in, sensors, id, [&] { return in.Get<uint8_t>() != 0; }, out);
  }
  in.ExpectEnd();
}

void ReadRigs(Lines in, SparseModel& out) {
  while (in.Next(false)) {
    const uint32_t id = in.Id("rig");
    const int64_t sensors = in.Integer();
    if (sensors < 0 || static_cast<uint64_t>(sensors) > in.Left())
      in.Fail(fmt::format("rig {} of {} sensors", id, sensors));
    ReadRig(
        in, static_cast<size_t>(sensors), id, [&] { return in.Integer() != 0; }, out);
  }
}

template <typename Input>
void ReadFrame(Input& in, const std::function<size_t()>& count, const std::function<int64_t()>& data_id,
               SparseModel& out) {
  ModelFrame frame;
  frame.id = in.Id("frame");
  frame.rig = in.Id("rig");
  frame.rig_from_world = in.Pose();
  const size_t n = count();
  for (size_t k = 0; k < n; ++k) {
    const int type = SensorType(in);
    in.Id("sensor");
    const int64_t image = data_id();
    if (type != kCameraSensor) continue;
    if (image < 0 || image >= std::numeric_limits<uint32_t>::max()) in.Fail(fmt::format("image {} is no id", image));
    frame.images.push_back(static_cast<uint32_t>(image));
  }
  out.frames.push_back(std::move(frame));
}

void ReadFrames(Bytes in, SparseModel& out) {
  const size_t n = in.Count(in.Get<uint64_t>(), 68, "frames");
  for (size_t i = 0; i < n; ++i) {
    ReadFrame(
        in, [&] { return in.Count(in.Get<uint32_t>(), 16, "images of a frame"); }, [&] { return in.Get<int64_t>(); },
        out);
  }
  in.ExpectEnd();
}

void ReadFrames(Lines in, SparseModel& out) {
  while (in.Next(false)) {
    ReadFrame(
        in,
        [&] {
          const int64_t n = in.Integer();
          if (n < 0 || static_cast<uint64_t>(n) != in.Left() / 3) in.Fail("the list of images is cut off");
          return static_cast<size_t>(n);
        },
        [&] { return in.Integer(); }, out);
  }
}

using ImagesById = std::unordered_map<uint32_t, const ModelImage*>;

// Rigs and frames name what is there, and poses of images are those of their frames.
void CheckRigs(const SparseModel& model, const std::unordered_set<uint32_t>& cameras, const ImagesById& images,
               const std::string& where) {
  const auto fail = [&](const std::string& what) { throw InputError(where + ": " + what); };
  std::unordered_map<uint32_t, const ModelRig*> rigs;
  for (const ModelRig& rig : model.rigs) {
    if (!rigs.emplace(rig.id, &rig).second) fail(fmt::format("rig {} is there twice", rig.id));
    std::unordered_set<uint32_t> seen;
    for (const auto& [camera, pose] : rig.cameras) {
      if (cameras.count(camera) == 0) fail(fmt::format("rig {}: its camera {} is not in the model", rig.id, camera));
      if (!seen.insert(camera).second) fail(fmt::format("rig {}: camera {} is in it twice", rig.id, camera));
    }
  }
  std::unordered_set<uint32_t> frame_ids, taken;
  for (const ModelFrame& frame : model.frames) {
    if (!frame_ids.insert(frame.id).second) fail(fmt::format("frame {} is there twice", frame.id));
    const auto rig = rigs.find(frame.rig);
    if (rig == rigs.end()) fail(fmt::format("frame {}: its rig {} is not in the model", frame.id, frame.rig));
    for (uint32_t id : frame.images) {
      if (!taken.insert(id).second) fail(fmt::format("image {} belongs to two frames", id));
      const auto image = images.find(id);
      if (image == images.end()) continue;  // a frame also lists images without a pose
      const Rigid3d* cam_from_rig = nullptr;
      for (const auto& [camera, pose] : rig->second->cameras) {
        if (camera == image->second->camera_id) cam_from_rig = &pose;
      }
      if (cam_from_rig == nullptr) {
        fail(fmt::format("frame {}: camera {} of image {} is not in rig {}", frame.id, image->second->camera_id, id,
                         frame.rig));
      }
      const Vector6d d = image->second->cam_from_world.Minus(*cam_from_rig * frame.rig_from_world);
      if (!(d.norm() <= 1e-6 * (1 + frame.rig_from_world.translation.norm()))) {
        fail(fmt::format("image {}: its pose differs from that of its frame {} by {:.3g}", image->second->name,
                         frame.id, d.norm()));
      }
    }
  }
}

// Ids are unique and what they name is there; tracks and images say the same.
void CheckIds(const SparseModel& model, const std::string& where) {
  const auto fail = [&](const std::string& what) { throw InputError(where + ": " + what); };
  std::unordered_set<uint32_t> cameras;
  for (const auto& [id, camera] : model.cameras) {
    if (!cameras.insert(id).second) fail(fmt::format("camera {} is there twice", id));
  }
  std::unordered_set<int64_t> points;
  for (const ModelPoint& point : model.points) {
    if (point.id < 0) fail(fmt::format("point {} is no id", point.id));
    if (!points.insert(point.id).second) fail(fmt::format("point {} is there twice", point.id));
  }
  ImagesById images;
  std::unordered_set<std::string> names;
  for (const ModelImage& image : model.images) {
    if (image.name.empty()) fail(fmt::format("image {} has no name", image.id));
    if (!images.emplace(image.id, &image).second) fail(fmt::format("image {} is there twice", image.id));
    if (!names.insert(image.name).second) fail("image " + image.name + " is there twice");
    if (cameras.count(image.camera_id) == 0) {
      fail(fmt::format("image {}: its camera {} is not in the model", image.name, image.camera_id));
    }
    for (int64_t point : image.points) {
      if (point != -1 && points.count(point) == 0) {
        fail(fmt::format("image {}: its point {} is not in the model", image.name, point));
      }
    }
  }
  for (const ModelPoint& point : model.points) {
    for (const auto& [id, index] : point.track) {
      const auto image = images.find(id);
      if (image == images.end()) fail(fmt::format("point {}: its image {} is not in the model", point.id, id));
      if (index >= image->second->pixels.size()) {
        fail(fmt::format("point {}: image {} has no pixel {}, only {}", point.id, id, index,
                         image->second->pixels.size()));
      }
    }
  }
  CheckRigs(model, cameras, images, where);
}

std::string ReadBytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  if (!in) throw InputError(file.string() + ": cannot be read");
  std::string bytes(static_cast<size_t>(in.tellg()), '\0');
  in.seekg(0).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(in.gcount()));
  return bytes;
}

// A file's content by its name; nothing if it isn't there. Asked for one by one, since only one is held at a time.
using Content = std::function<std::optional<std::string>(const std::string& name)>;

// Calls `read` with the file as bytes or lines. False if it isn't there.
template <typename Read>
bool With(const Content& content, const std::string& where, const std::string& stem, bool binary, const Read& read) {
  const std::string name = stem + (binary ? ".bin" : ".txt");
  const std::optional<std::string> bytes = content(name);
  if (!bytes) return false;
  const std::string file = (fs::path(where) / name).string();
  if (binary) {
    read(Bytes(file, *bytes));
  } else {
    read(Lines(file, *bytes));
  }
  return true;
}

SparseModel Parse(const Content& content, bool binary, const std::string& where) {
  SparseModel model;
  const auto need = [&](const char* stem, bool found) {
    if (found) return;
    throw InputError(fmt::format("{}: {}.{} is missing; a COLMAP model is cameras, images and points3D, .bin or .txt",
                                 where, stem, binary ? "bin" : "txt"));
  };
  need("cameras", With(content, where, "cameras", binary, [&](auto in) { ReadCameras(std::move(in), model); }));
  need("images", With(content, where, "images", binary, [&](auto in) { ReadImages(std::move(in), model); }));
  need("points3D", With(content, where, "points3D", binary, [&](auto in) { ReadPoints(std::move(in), model); }));
  With(content, where, "rigs", binary, [&](auto in) { ReadRigs(std::move(in), model); });
  With(content, where, "frames", binary, [&](auto in) { ReadFrames(std::move(in), model); });
  CheckIds(model, where);
  return model;
}

}  // namespace

SparseModel ParseColmapModel(const std::map<std::string, std::string>& files, const std::string& where) {
  const auto content = [&files](const std::string& name) -> std::optional<std::string> {
    const auto it = files.find(name);
    return it == files.end() ? std::nullopt : std::optional(it->second);
  };
  return Parse(content, files.count("cameras.bin") > 0, where);
}

bool HasColmapModel(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / "cameras.bin", ignored) || fs::exists(dir / "cameras.txt", ignored);
}

SparseModel ReadColmapModel(const fs::path& dir) {
  if (!HasColmapModel(dir)) {
    throw InputError(dir.string() + ": no COLMAP model here; expected cameras, images and points3D, .bin or .txt");
  }
  const auto content = [&dir](const std::string& name) -> std::optional<std::string> {
    const fs::path file = dir / name;
    return fs::is_regular_file(file) ? std::optional(ReadBytes(file)) : std::nullopt;
  };
  return Parse(content, fs::exists(dir / "cameras.bin"), dir.string());
}

}  // namespace trigpoint
