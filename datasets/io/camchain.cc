#include "datasets/io/camchain.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

const std::vector<std::string> kKeys = {
    "camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution", "rostopic", "T_cam_imu",
    "T_imu_cam",    "T_cn_cnm1",  "cam_overlaps",     "timeshift_cam_imu", "readout_s",  "crop"};

constexpr double kLongestReadout_s = 0.2;

constexpr double kWidest360 = 65534, kLongestSide = 1e6;

Rigid3d ReadTransform(const YamlMap& map, const std::string& key) {
  const YAML::Node rows = map.Node(key);
  Eigen::Matrix4d m;
  bool good = rows.IsSequence() && rows.size() == 4;
  for (size_t i = 0; good && i < 4; ++i) {
    good = rows[i].IsSequence() && rows[i].size() == 4;
    for (size_t k = 0; good && k < 4; ++k) {
      const auto value = rows[i][k].IsScalar() ? ParseDouble(rows[i][k].Scalar()) : std::nullopt;
      good = value && std::isfinite(*value);
      if (good) m(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = *value;
    }
  }
  if (!good) map.Fail(key, "expected 4 rows of 4 numbers, a transform's matrix");
  try {
    return RigidFromMatrix(m);
  } catch (const InputError& e) {
    map.Fail(key, e.what());
  }
}

// The part of the stored picture that the camera sees, if not all of it. Its size is the resolution.
PicturePart ReadCrop(const YamlMap& map, const Camera& camera) {
  PicturePart part;
  if (!map.Has("crop")) return part;
  const std::vector<double> crop = map.Numbers("crop", 4);
  if (camera.model() == CameraModel::kEquirectangular)
    map.Fail("crop", "an equirectangular camera has no crop; remove the key");
  const auto is_pixel = [](double v) {
    return v >= 0 && v <= std::numeric_limits<uint16_t>::max() && v == std::floor(v);
  };
  if (!is_pixel(crop[0]) || !is_pixel(crop[1]) || crop[2] != camera.width() || crop[3] != camera.height()) {
    map.Fail("crop",
             "expected [left, top, width, height] in pixels of the stored picture, with the size of resolution, " +
                 std::to_string(camera.width()) + " x " + std::to_string(camera.height()));
  }
  part.kind = PicturePart::Kind::kCrop;
  part.x = static_cast<uint16_t>(crop[0]);
  part.y = static_cast<uint16_t>(crop[1]);
  return part;
}

Camera ReadCamera(const YamlMap& map) {
  const std::string model = map.Text("camera_model", "pinhole");
  if (model == "equirectangular") {
    const std::vector<double> size = map.Numbers("resolution", 2);
    if (size[0] < 2 || size[0] > kWidest360 || size[0] != 2 * size[1]) {
      map.Fail("resolution", "expected a picture twice as wide as high, at most 65534 px wide");
    }
    return Camera::Equirectangular(static_cast<int>(size[0]), static_cast<int>(size[1]));
  }
  if (model != "pinhole") {
    map.Fail("camera_model", "expected pinhole or equirectangular, found '" + model + "'; " +
                                 "recalibrate as pinhole with radtan or (for a fisheye) equidistant distortion");
  }
  std::vector<double> params = map.Numbers("intrinsics", 4);
  const std::vector<double> size = map.Numbers("resolution", 2);
  for (const double side : size) {
    if (!(side >= 1 && side <= kLongestSide) || side != std::floor(side)) {
      map.Fail("resolution", "expected [width, height] of the pictures in whole pixels, 1 to 1000000");
    }
  }
  std::vector<double> distortion = map.Numbers("distortion_coeffs");
  const std::string distortion_model = map.Text("distortion_model", distortion.empty() ? "none" : "radtan");
  params.insert(params.end(), distortion.begin(), distortion.end());
  const size_t n = distortion.size();
  CameraModel kind = CameraModel::kPinhole;
  std::string expected;
  if (distortion_model == "radtan" || distortion_model == "plumb_bob" || distortion_model == "rational_polynomial") {
    kind = n == 8 ? CameraModel::kRational : CameraModel::kRadtan;
    if (n != 4 && n != 5 && n != 8) expected = "4, 5 or 8";
  } else if (distortion_model == "equidistant") {
    kind = CameraModel::kKannalaBrandt;
    if (n != 4) expected = "4";
  } else if (distortion_model == "none") {
    if (n != 0) expected = "no";
  } else {
    map.Fail("distortion_model", "expected radtan, equidistant or none, found '" + distortion_model + "'");
  }
  if (!expected.empty()) {
    map.Fail("distortion_coeffs",
             "expected " + expected + " coefficients for " + distortion_model + ", found " + std::to_string(n));
  }
  try {
    return {kind, static_cast<int>(size[0]), static_cast<int>(size[1]), std::move(params)};
  } catch (const InputError& e) {
    map.Fail("intrinsics", e.what());
  }
}

std::string Rows(const Rigid3d& transform) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = transform.rotation.toRotationMatrix();
  m.topRightCorner<3, 1>() = transform.translation;
  std::string text;
  for (int i = 0; i < 4; ++i) text += "  - " + YamlList({m(i, 0), m(i, 1), m(i, 2), m(i, 3)}) + "\n";
  return text;
}

double ReadReadout(const YamlMap& map, const BodyCamera& camera) {
  const double readout_s = map.Number("readout_s", 0);
  if (std::abs(readout_s) > kLongestReadout_s) {
    map.Fail("readout_s",
             "expected seconds from the first row to the last, at most 0.2, found " + map.Text("readout_s"));
  }
  const bool whole = camera.part.kind == PicturePart::Kind::kAll;
  if (readout_s != 0 && (!whole || camera.camera.model() == CameraModel::kEquirectangular)) {
    map.Fail("readout_s",
             "a 360 camera or a crop does not have the rows of a sensor, and so no readout time; remove the key");
  }
  return readout_s;
}

}  // namespace

Rigid3d LevelForwardCamera() {
  Eigen::Matrix3d r;
  r << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return {Eigen::Quaterniond(r), Eigen::Vector3d::Zero()};
}

Rigid3d RigidFromMatrix(const Eigen::Matrix4d& m) {
  constexpr double kTolerance = 1e-3;
  const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
  const double skew = (r.transpose() * r - Eigen::Matrix3d::Identity()).norm();
  if (!(skew <= kTolerance) || !(r.determinant() > 0) || !m.col(3).allFinite() ||
      (m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() > 1e-6) {
    char found[120];
    std::snprintf(found, sizeof found, " (its rotation has determinant %.4g and is %.2g off orthonormal)",
                  r.determinant(), skew);
    throw InputError(
        std::string("expected a rotation and a translation (last row 0 0 0 1), found a matrix that is no ") +
        "rigid motion" + found);
  }
  return {Eigen::Quaterniond(r), m.topRightCorner<3, 1>()};
}

std::vector<BodyCamera> ReadCamchain(const std::filesystem::path& file) {
  const YamlMap top = YamlMap::AnyKeys(file, LoadYaml(file));
  if (top.Keys().empty()) throw InputError(file.string() + ": no camera in it; expected a map cam0: {...}");
  std::vector<BodyCamera> cameras;
  for (const std::string& name : top.Keys()) {
    if (!top.Node(name).IsMap()) {
      top.Fail(name, "expected a camera (a map with camera_model, intrinsics, ...): is this a Kalibr camchain?");
    }
    const YamlMap map = top.Map(name, kKeys);
    BodyCamera camera;
    camera.name = name;
    camera.camera = ReadCamera(map);
    camera.part = ReadCrop(map, camera.camera);
    if (map.Has("T_cam_imu")) {
      camera.cam_from_body = ReadTransform(map, "T_cam_imu");
      camera.has_extrinsics = true;
    } else if (map.Has("T_imu_cam")) {
      camera.cam_from_body = ReadTransform(map, "T_imu_cam").Inverse();
      camera.has_extrinsics = true;
    } else if (cameras.empty()) {
      camera.cam_from_body = LevelForwardCamera();
    } else if (map.Has("T_cn_cnm1")) {
      camera.cam_from_body = ReadTransform(map, "T_cn_cnm1") * cameras.back().cam_from_body;
      camera.has_extrinsics = cameras.back().has_extrinsics;
    } else {
      throw InputError(file.string() + ": camera '" + name +
                       "' has neither T_cam_imu nor T_cn_cnm1; its place on the body must be given when there are "
                       "several cameras");
    }
    camera.time_offset_s = map.Number("timeshift_cam_imu", 0);
    camera.readout_s = ReadReadout(map, camera);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

int64_t BodyStamp(int64_t image_stamp_ns, const BodyCamera& camera) {
  return image_stamp_ns + std::llround(camera.time_offset_s * 1e9);
}

void TakeLenses(const std::vector<BodyCamera>& from, std::vector<BodyCamera>* cameras) {
  for (BodyCamera& camera : *cameras) {
    for (const BodyCamera& used : from) {
      if (used.name != camera.name || used.camera.model() == CameraModel::kEquirectangular) continue;
      camera.camera = used.camera;
      camera.focal_sigma_share = used.focal_sigma_share;
    }
  }
}

void WriteCamchain(const std::filesystem::path& file, const std::vector<BodyCamera>& cameras,
                   const std::vector<std::string>& comments) {
  std::string text = CommentLines(comments);
  const BodyCamera* before = nullptr;
  for (const BodyCamera& camera : cameras) {
    if (camera.IsFurtherView()) continue;
    const std::vector<double>& params = camera.camera.params();
    const bool sphere = camera.part.kind == PicturePart::Kind::kView;
    const int width = sphere ? camera.part.x : camera.camera.width();
    const int height = sphere ? camera.part.y : camera.camera.height();
    const std::string size = std::to_string(width) + ", " + std::to_string(height) + "]\n";
    std::string distortion;
    switch (camera.camera.model()) {
      case CameraModel::kPinhole: distortion = "none"; break;
      case CameraModel::kRadtan:
      case CameraModel::kRational: distortion = "radtan"; break;
      case CameraModel::kKannalaBrandt: distortion = "equidistant"; break;
      case CameraModel::kEquirectangular: break;
    }
    text += camera.name + ":\n";
    if (sphere || distortion.empty()) {
      text += "  camera_model: equirectangular\n";
    } else {
      text += "  camera_model: pinhole\n  intrinsics: " + YamlList({params.begin(), params.begin() + 4}) +
              "\n  distortion_model: " + distortion +
              "\n  distortion_coeffs: " + YamlList({params.begin() + 4, params.end()}) + "\n";
    }
    text += "  resolution: [" + size;
    if (camera.part.kind == PicturePart::Kind::kCrop) {
      text += "  crop: [" + std::to_string(camera.part.x) + ", " + std::to_string(camera.part.y) + ", " + size;
    }
    if (camera.readout_s != 0) text += "  readout_s: " + YamlNumber(camera.readout_s) + "\n";
    if (camera.time_offset_s != 0) text += "  timeshift_cam_imu: " + YamlNumber(camera.time_offset_s) + "\n";
    if (camera.has_extrinsics) {
      text += "  T_cam_imu:   # camera from body (x forward, y left, z up)\n" + Rows(camera.cam_from_body);
    } else if (before != nullptr) {
      text += "  T_cn_cnm1:   # this camera from the one before\n" +
              Rows(camera.cam_from_body * before->cam_from_body.Inverse());
    }
    before = &camera;
  }
  WriteFileAtomically(file, text);
}

}  // namespace trigpoint
