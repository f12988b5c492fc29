#include "datasets/calibration/camera_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/colmap/camera_models.h"
#include "datasets/colmap/model.h"
#include "datasets/io/camchain.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

BodyCamera Named(const std::string& name, Camera camera) {
  BodyCamera body;
  body.name = name;
  body.camera = std::move(camera);
  return body;
}

// In pixels, 0 where it is no whole number that a picture has: its camera is refused.
int PictureSide(double value) {
  constexpr double kLongest = 1e6;
  return value >= 1 && value <= kLongest && value == std::floor(value) ? static_cast<int>(value) : 0;
}

void AppendNumbers(const YAML::Node& node, const std::string& where, std::vector<double>* numbers) {
  if (node.IsSequence()) {
    for (const auto& item : node) AppendNumbers(item, where, numbers);
    return;
  }
  const auto value = node.IsScalar() ? ParseDouble(node.Scalar()) : std::nullopt;
  if (!value || !std::isfinite(*value)) throw InputError(where + ": expected numbers");
  numbers->push_back(*value);
}

// A top-level map in which the same thing has several names.
class LooseMap {
 public:
  LooseMap(fs::path file, const YAML::Node& node) : file_(std::move(file)), node_(node) {}
  YAML::Node Find(const std::vector<std::string>& names) const {
    for (const auto& entry : node_) {
      if (std::find(names.begin(), names.end(), entry.first.Scalar()) != names.end()) return entry.second;
    }
    return YAML::Node(YAML::NodeType::Undefined);
  }
  // A list, a nested list, or a matrix {rows, cols, data}; empty if missing.
  std::vector<double> Numbers(const std::vector<std::string>& names) const {
    YAML::Node node = Find(names);
    if (!node.IsDefined() || node.IsNull()) return {};
    if (node.IsMap()) node = node["data"];
    std::vector<double> numbers;
    if (node.IsDefined()) AppendNumbers(node, file_.string() + ": key '" + names.front() + "'", &numbers);
    return numbers;
  }
  int Integer(const std::vector<std::string>& names) const {
    const std::vector<double> numbers = Numbers(names);
    return numbers.empty() ? 0 : PictureSide(numbers.front());
  }
  std::string Text(const std::vector<std::string>& names) const {
    const YAML::Node node = Find(names);
    return node.IsDefined() && node.IsScalar() ? node.Scalar() : "";
  }

 private:
  fs::path file_;
  YAML::Node node_;
};

// R and T of a stereo pair. Throws InputError for what no pair has.
Rigid3d StereoTransform(const fs::path& file, const std::vector<double>& r, const std::vector<double>& t) {
  constexpr double kLongest_m = 10;
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  m.topRightCorner<3, 1>() = Eigen::Map<const Eigen::Vector3d>(t.data());
  Rigid3d second_from_first;
  try {
    second_from_first = RigidFromMatrix(m);
  } catch (const InputError& e) {
    throw InputError(file.string() + ": key 'R': " + e.what());
  }
  if (const double length = second_from_first.translation.norm(); length > kLongest_m) {
    throw InputError(
        fmt::format("{}: key 'T': expected metres and a baseline of at most {} m, found one of {:.4g}; if "
                    "it is in millimetres, divide T by 1000",
                    file.string(), kLongest_m, length));
  }
  return second_from_first;
}

CameraFile ReadMapOfCameras(const fs::path& file, const YAML::Node& node, int width, int height) {
  if (!node.IsMap()) throw InputError(file.string() + ": expected a camera calibration, found no map");
  CameraFile result;
  for (const auto& entry : node) {
    if (entry.second.IsMap() && entry.second["intrinsics"]) {
      result.format = "Kalibr";
      result.cameras = ReadCamchain(file);
      result.related = true;
      return result;
    }
  }
  result.format = "OpenCV or ROS";
  const LooseMap map(file, node);
  if (const int w = map.Integer({"image_width", "width", "image_Width"}); w > 0) width = w;
  if (const int h = map.Integer({"image_height", "height", "image_Height"}); h > 0) height = h;
  if (const std::vector<double> size = map.Numbers({"image_size", "imageSize"}); size.size() == 2) {
    width = PictureSide(size[0]);
    height = PictureSide(size[1]);
  }
  const std::string model = map.Text({"distortion_model", "camera_model"});
  if (const std::vector<double> first = map.Numbers({"M1"}); !first.empty()) {
    result.cameras.push_back(
        Named("cam0", OpenCvCamera(file.string(), first, map.Numbers({"D1"}), model, width, height)));
    result.cameras.push_back(
        Named("cam1", OpenCvCamera(file.string(), map.Numbers({"M2"}), map.Numbers({"D2"}), model, width, height)));
    const std::vector<double> r = map.Numbers({"R"}), t = map.Numbers({"T"});
    if (r.size() == 9 && t.size() == 3) {
      result.cameras[1].cam_from_body = StereoTransform(file, r, t);
      result.related = true;
    }
    return result;
  }
  const std::vector<double> k =
      map.Numbers({"camera_matrix", "cameraMatrix", "Camera_Matrix", "camera_Matrix", "K", "k"});
  if (k.empty()) {
    throw InputError(file.string() +
                     ": no camera in it; expected a Kalibr camchain, OpenCV's or ROS' camera_matrix, or COLMAP's "
                     "cameras.txt");
  }
  const std::vector<double> d = map.Numbers(
      {"distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs", "dist_coeff", "D", "d"});
  result.cameras.push_back(Named("cam0", OpenCvCamera(file.string(), k, d, model, width, height)));
  result.related = true;
  return result;
}

// What OpenCV's FileStorage holds, as the same in YAML.
YAML::Node NodeOf(const cv::FileNode& stored) {
  YAML::Node node;
  if (stored.isMap()) {
    for (const std::string& key : stored.keys()) node[key] = NodeOf(stored[key]);
  } else if (stored.isSeq()) {
    for (const cv::FileNode& item : stored) node.push_back(NodeOf(item));
  } else if (stored.isInt()) {
    node = static_cast<int>(stored);
  } else if (stored.isReal()) {
    node = YamlNumber(static_cast<double>(stored));
  } else if (stored.isString()) {
    node = stored.string();
  }
  return node;
}

// OpenCV's reader needs stack for each level: too deep a file would end the program. A file that is cut off could pass
// as one with fewer coefficients.
void CheckElements(const fs::path& file, const std::string& text) {
  constexpr int kDeepest = 64;
  int depth = 0;
  for (size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    const char next = at + 1 < text.size() ? text[at + 1] : '>';
    if (next == '?' || next == '!') continue;
    const size_t end = text.find('>', at);
    if (next == '/') {
      --depth;
    } else if (end != std::string::npos && text[end - 1] != '/' && ++depth > kDeepest) {
      throw InputError(fmt::format("{}: expected XML at most {} levels deep", file.string(), kDeepest));
    }
  }
  if (depth > 0) throw InputError(file.string() + ": cut off: XML elements have no end; copy or export it again");
}

CameraFile ReadOpenCvXml(const fs::path& file, const std::string& text, int width, int height) {
  CheckElements(file, text);
  YAML::Node node;
  try {
    const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_XML);
    node = NodeOf(storage.root());
  } catch (const InputError&) {
    throw;
  } catch (const std::exception&) {  // cv::Exception, and what the library lets pass from below
    throw InputError(file.string() + ": expected XML as OpenCV writes it, found a fault in it; write it again");
  }
  return ReadMapOfCameras(file, node, width, height);
}

CameraFile ReadJsonCamera(const fs::path& file, const std::string& text, int width, int height) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) throw InputError(file.string() + ": not valid JSON");
  const auto data = [&](const char* key) {
    std::vector<double> numbers;
    const auto it = json.find(key);
    if (it == json.end() || !it->is_object() || !it->contains("data") || !it->at("data").is_array()) return numbers;
    for (const auto& value : it->at("data")) {
      if (!value.is_number()) throw InputError(file.string() + ": key '" + key + "': expected numbers");
      numbers.push_back(value.get<double>());
    }
    return numbers;
  };
  if (const auto it = json.find("resolution"); it != json.end() && it->is_object()) {
    if (it->contains("width") && it->at("width").is_number()) width = PictureSide(it->at("width").get<double>());
    if (it->contains("height") && it->at("height").is_number()) height = PictureSide(it->at("height").get<double>());
  }
  CameraFile result;
  result.format = "JSON";
  result.cameras.push_back(
      Named("cam0", OpenCvCamera(file.string(), data("cameraIntrinsics"), data("distCoeffs"), "", width, height)));
  result.related = true;
  return result;
}

// One element of Agisoft's XML: its attributes and what it holds.
struct XmlPart {
  std::string_view attributes, content;
};

// The elements of this name in `text`, in order; those of the same name are not nested there.
std::vector<XmlPart> XmlParts(std::string_view text, const std::string& name) {
  std::vector<XmlPart> parts;
  const std::string open = "<" + name, close = "</" + name + ">";
  for (size_t at = text.find(open); at != std::string_view::npos; at = text.find(open, at)) {
    at += open.size();
    const size_t end = text.find('>', at);
    if (end == std::string_view::npos) break;
    if (text[at] != '>' && text[at] != ' ' && text[at] != '/') continue;  // a longer name
    XmlPart part{text.substr(at, end - at), {}};
    at = end + 1;
    if (!part.attributes.ends_with('/')) {
      const size_t last = std::min(text.find(close, at), text.size());
      part.content = text.substr(at, last - at);
      at = last;
    }
    parts.push_back(part);
  }
  return parts;
}

std::string XmlAttribute(const XmlPart& part, const std::string& name) {
  const std::string begin = " " + name + "=\"";
  const size_t at = part.attributes.find(begin);
  if (at == std::string_view::npos) return "";
  const std::string_view rest = part.attributes.substr(at + begin.size());
  return std::string(rest.substr(0, rest.find('"')));
}

// Agisoft's lens: its pixels begin at 0.5, cx and cy count from the middle, its p1 and p2 are OpenCV's p2 and p1.
// `where` begins the messages.
Camera AgisoftCamera(const std::string& where, const XmlPart& lens) {
  const auto element = [&](const std::string& name) {
    const std::vector<XmlPart> parts = XmlParts(lens.content, name);
    return parts.empty() ? std::string() : std::string(Trim(parts.front().content));
  };
  const auto parsed = [&](const std::string& name, const std::string& written) {
    const auto value = written.empty() ? std::optional<double>(0) : ParseDouble(written);
    if (!value || !std::isfinite(*value))
      throw InputError(where + ": <" + name + ">: expected a number, found '" + written + "'");
    return *value;
  };
  const auto number = [&](const std::string& name) { return parsed(name, element(name)); };
  const std::string type = XmlAttribute(lens, "type"), projection = type.empty() ? element("projection") : type;
  if (projection != "frame" && projection != "fisheye") {
    throw InputError(where + ": <projection>: expected frame or fisheye, found '" + projection + "'");
  }
  const std::vector<XmlPart> resolution = XmlParts(lens.content, "resolution");
  const bool stated = !resolution.empty();
  const double width = stated ? parsed("width", XmlAttribute(resolution.front(), "width")) : number("width");
  const double height = stated ? parsed("height", XmlAttribute(resolution.front(), "height")) : number("height");
  const double f = number("f");
  if (!(f > 0)) throw InputError(where + ": <f>: expected the focal length in px, as Agisoft Metashape writes it");
  const bool fisheye = projection == "fisheye", tangential = number("p1") != 0 || number("p2") != 0;
  if (number("b2") != 0 || number("p3") != 0 || number("p4") != 0 || (fisheye ? tangential : number("k4") != 0)) {
    throw InputError(where + ": " + (fisheye ? "p1, p2" : "k4") +
                     ", p3, p4 or b2 are not supported; calibrate without them");
  }
  std::vector<double> d = {number("k1"), number("k2"), number("p2"), number("p1"), number("k3")};
  if (fisheye) d = {number("k1"), number("k2"), number("k3"), number("k4")};
  const std::vector<double> k = {
      f + number("b1"), 0, 0.5 * (width - 1) + number("cx"), 0, f, 0.5 * (height - 1) + number("cy"), 0, 0, 1};
  return OpenCvCamera(where, k, d, fisheye ? "fisheye" : "", PictureSide(width), PictureSide(height));
}

// The XML of one lens, or cameras.xml with the sensors of a project: of each the adjusted calibration, else the first.
CameraFile ReadAgisoftCameras(const fs::path& file, const std::string& text) {
  CheckElements(file, text);
  CameraFile result;
  result.format = "Agisoft";
  for (const XmlPart& sensor : XmlParts(text, "sensor")) {
    const std::vector<XmlPart> lenses = XmlParts(sensor.content, "calibration");
    if (lenses.empty()) continue;
    const auto adjusted = std::find_if(lenses.begin(), lenses.end(),
                                       [](const XmlPart& l) { return XmlAttribute(l, "class") == "adjusted"; });
    const std::string where = file.string() + ": sensor '" + XmlAttribute(sensor, "label") + "'";
    result.cameras.push_back(Named("cam" + std::to_string(result.cameras.size()),
                                   AgisoftCamera(where, adjusted != lenses.end() ? *adjusted : lenses.front())));
  }
  if (result.cameras.empty()) {
    const std::vector<XmlPart> lenses = XmlParts(text, "calibration");
    if (lenses.empty()) throw InputError(file.string() + ": expected sensors with a calibration, found none");
    result.cameras.push_back(Named("cam0", AgisoftCamera(file.string(), lenses.front())));
  }
  result.related = result.cameras.size() == 1;
  return result;
}

// cameras.bin: the first file of a model, the others being empty.
CameraFile ReadColmapBinary(const fs::path& file, const std::string& bytes) {
  const std::string none(sizeof(uint64_t), '\0');
  const SparseModel model = ParseColmapModel({{"cameras.bin", bytes}, {"images.bin", none}, {"points3D.bin", none}},
                                             file.parent_path().string());
  CameraFile result;
  result.format = "COLMAP";
  for (const auto& [id, camera] : model.cameras) {
    result.cameras.push_back(Named("cam" + std::to_string(result.cameras.size()), camera));
  }
  if (result.cameras.empty()) throw InputError(file.string() + ": no camera in it");
  result.related = result.cameras.size() == 1;
  return result;
}

// The fields of a line of cameras.txt, or nothing.
std::vector<std::string_view> ColmapFields(std::string_view line) {
  const std::vector<std::string_view> fields = SplitFields(line);
  if (fields.size() < 5 || !ParseInt(fields[0]) || !ParseInt(fields[2]) || !ParseInt(fields[3])) return {};
  return fields;
}

CameraFile ReadColmapCameras(const fs::path& file, const std::string& text) {
  CameraFile result;
  result.format = "COLMAP";
  for (const auto& [line, number] : DataLines(text)) {
    const std::string where = FileLine(file, number);
    const std::vector<std::string_view> fields = ColmapFields(line);
    if (fields.empty()) throw InputError(where + ": expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS, as COLMAP writes it");
    ColmapCamera camera;
    camera.model_name = std::string(fields[1]);
    const ColmapModelInfo* model = FindColmapModel(fields[1]);
    if (model == nullptr) {
      throw InputError(where + ": unknown camera model " + camera.model_name +
                       "; expected one of COLMAP's, e.g. PINHOLE or OPENCV");
    }
    camera.model_id = model->id;
    camera.width = PictureSide(static_cast<double>(*ParseInt(fields[2])));
    camera.height = PictureSide(static_cast<double>(*ParseInt(fields[3])));
    if (camera.width == 0 || camera.height == 0) {
      throw InputError(fmt::format("{}: expected the size of the pictures, 1 to 1000000 px, found {} x {}", where,
                                   fields[2], fields[3]));
    }
    for (size_t i = 4; i < fields.size(); ++i) {
      const auto value = ParseDouble(fields[i]);
      if (!value) throw InputError(where + ": expected a number, found '" + std::string(fields[i]) + "'");
      camera.params.push_back(*value);
    }
    try {
      result.cameras.push_back(Named("cam" + std::to_string(result.cameras.size()), FromColmap(camera)));
    } catch (const InputError& e) {
      throw InputError(where + ": " + e.what());
    }
  }
  if (result.cameras.empty()) throw InputError(file.string() + ": no camera in it");
  result.related = result.cameras.size() == 1;
  return result;
}

bool LooksLikeColmap(const std::string& text) {
  const std::vector<DataLine> lines = DataLines(text);
  return !lines.empty() && !ColmapFields(lines.front().text).empty();
}

// K as nine numbers, and the coefficients.
std::vector<double> MatrixOf(const Camera& camera) {
  const std::vector<double>& p = camera.params();
  return {p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1};
}

std::vector<double> CoefficientsOf(const Camera& camera) {
  std::vector<double> d(camera.params().begin() + 4, camera.params().end());
  if (camera.model() == CameraModel::kPinhole || camera.model() == CameraModel::kRadtan) d.resize(5, 0.0);
  return d;
}

const char* RosModel(const fs::path& file, const Camera& camera) {
  switch (camera.model()) {
    case CameraModel::kPinhole:
    case CameraModel::kRadtan: return "plumb_bob";
    case CameraModel::kRational: return "rational_polynomial";
    case CameraModel::kKannalaBrandt: return "equidistant";
    case CameraModel::kEquirectangular: break;
  }
  throw OptionError(file.string() + ": an equirectangular camera has no place in this file");
}

}  // namespace

Camera OpenCvCamera(const std::string& where, const std::vector<double>& k, std::vector<double> d, std::string model,
                    int width, int height) {
  if (k.size() != 9)
    throw InputError(where + ": expected a camera matrix of 3 x 3 numbers, found " + std::to_string(k.size()));
  if (width <= 0 || height <= 0) {
    throw InputError(where +
                     ": expected the size of the pictures (image_width, image_height) in whole px, 1 to 1000000; add "
                     "it to the file");
  }
  if (std::abs(k[1]) > 1e-6 * std::abs(k[0])) throw InputError(where + ": a camera matrix with skew is not supported");
  std::vector<double> params = {k[0], k[4], k[2], k[5]};
  model = LowerCase(std::move(model));
  const bool fisheye = model == "equidistant" || model == "fisheye" || model == "kannala_brandt";
  static const std::vector<std::string> kKnown = {
      "",        "plumb_bob", "rational_polynomial", "radtan",  "rational",
      "pinhole", "none",      "equidistant",         "fisheye", "kannala_brandt"};
  if (std::find(kKnown.begin(), kKnown.end(), model) == kKnown.end()) {
    throw InputError(where + ": distortion_model: expected plumb_bob, rational_polynomial or equidistant, found '" +
                     model + "'");
  }
  // Coefficients that are there but zero (thin prism, tilt) change nothing.
  const size_t most = fisheye ? 4 : 8;
  while (d.size() > most && d.back() == 0) d.pop_back();
  CameraModel kind = CameraModel::kPinhole;
  if (fisheye) {
    kind = CameraModel::kKannalaBrandt;
    if (d.size() != 4) throw InputError(where + ": a fisheye has 4 coefficients, found " + std::to_string(d.size()));
  } else if (!d.empty()) {
    if (d.size() > 5) d.resize(std::max<size_t>(d.size(), 8), 0.0);
    if (d.size() < 4) d.resize(4, 0.0);
    if (d.size() > 8) {
      throw InputError(
          where + ": " + std::to_string(d.size()) +
          " distortion coefficients: thin prism and tilted sensors are not supported; recalibrate with 4, 5 "
          "or 8");
    }
    kind = d.size() == 8 ? CameraModel::kRational : CameraModel::kRadtan;
  }
  params.insert(params.end(), d.begin(), d.end());
  try {
    return {kind, width, height, params};
  } catch (const InputError& e) {
    throw InputError(where + ": " + e.what());
  }
}

CameraFile ReadCameraFile(const fs::path& file, int width, int height) {
  const std::string text = ReadTextFile(file);
  if (file.extension() == ".bin") return ReadColmapBinary(file, text);
  const std::string_view trimmed = Trim(text);
  if (!trimmed.empty() && trimmed.front() == '{') return ReadJsonCamera(file, text, width, height);
  if (text.find("<opencv_storage") != std::string::npos) return ReadOpenCvXml(file, text, width, height);
  if (text.find("<calibration") != std::string::npos) return ReadAgisoftCameras(file, text);
  if (LooksLikeColmap(text)) return ReadColmapCameras(file, text);
  return ReadMapOfCameras(file, ParseYaml(file, text), width, height);
}

std::vector<BodyCamera> ReadCamerasFor(const fs::path& file, size_t count, const std::string& of, int width,
                                       int height) {
  CameraFile read = ReadCameraFile(file, width, height);
  std::string names;
  for (const BodyCamera& camera : read.cameras) names += (names.empty() ? "" : ", ") + camera.name;
  if (read.cameras.size() != count) {
    throw InputError(file.string() + ": expected " + Counted(count, "camera") + ", as " + of + " has, found " +
                     std::to_string(read.cameras.size()) + " (" + names +
                     "); leave the others out of the file, or take one by trigpoint calibrate DIR --from FILE --set "
                     "from_camera=NAME and name the result in run.yaml (camera: NAME)");
  }
  if (count > 1 && !read.related) {
    throw InputError(file.string() + ": expected how its cameras " + names +
                     " sit to each other, found no such poses; name a Kalibr camchain.yaml with T_cn_cnm1 or "
                     "T_cam_imu, or import the pictures of one camera");
  }
  for (size_t i = 0; i < count; ++i) read.cameras[i].name = "cam" + std::to_string(i);
  return std::move(read.cameras);
}

void WriteOpenCvCamera(const fs::path& file, const BodyCamera& camera, const std::vector<std::string>& comments) {
  const auto matrix = [](const char* name, size_t rows, size_t cols, const std::vector<double>& data) {
    return std::string(name) + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
           "\n   cols: " + std::to_string(cols) + "\n   dt: d\n   data: " + YamlList(data) + "\n";
  };
  const std::vector<double> d = CoefficientsOf(camera.camera);
  WriteFileAtomically(file, "%YAML:1.0\n---\n" + CommentLines(comments) +
                                "image_width: " + std::to_string(camera.camera.width()) +
                                "\nimage_height: " + std::to_string(camera.camera.height()) + "\ncamera_name: \"" +
                                camera.name + "\"\ndistortion_model: \"" + RosModel(file, camera.camera) + "\"\n" +
                                matrix("camera_matrix", 3, 3, MatrixOf(camera.camera)) +
                                matrix("distortion_coefficients", d.size(), 1, d));
}

void WriteRosCameraInfo(const fs::path& file, const BodyCamera& camera, const std::vector<std::string>& comments) {
  const auto matrix = [](const char* name, size_t rows, size_t cols, const std::vector<double>& data) {
    return std::string(name) + ":\n  rows: " + std::to_string(rows) + "\n  cols: " + std::to_string(cols) +
           "\n  data: " + YamlList(data) + "\n";
  };
  const std::vector<double>& p = camera.camera.params();
  const std::vector<double> d = CoefficientsOf(camera.camera);
  WriteFileAtomically(file, CommentLines(comments) + "image_width: " + std::to_string(camera.camera.width()) +
                                "\nimage_height: " + std::to_string(camera.camera.height()) + "\ncamera_name: " +
                                camera.name + "\n" + matrix("camera_matrix", 3, 3, MatrixOf(camera.camera)) +
                                "distortion_model: " + RosModel(file, camera.camera) + "\n" +
                                matrix("distortion_coefficients", 1, d.size(), d) +
                                matrix("rectification_matrix", 3, 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
                                matrix("projection_matrix", 3, 4, {p[0], 0, p[2], 0, 0, p[1], p[3], 0, 0, 0, 1, 0}));
}

void WriteColmapCameras(const fs::path& file, const std::vector<BodyCamera>& cameras,
                        const std::vector<std::string>& comments) {
  std::string text = CommentLines(comments) + "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]; pixel centres at 0.5\n";
  int id = 0;
  for (const BodyCamera& camera : cameras) {
    const ColmapCamera colmap = ToColmap(camera.camera);
    text += std::to_string(++id) + " " + colmap.model_name + " " + std::to_string(colmap.width) + " " +
            std::to_string(colmap.height);
    for (double p : colmap.params) {
      text += ' ';
      text += YamlNumber(p);
    }
    text += "\n";
  }
  WriteFileAtomically(file, text);
}

}  // namespace trigpoint
