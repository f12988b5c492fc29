#include "datasets/import/dataset_run.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/import/run_folder.h"
#include "datasets/import/source_links.h"
#include "datasets/io/camchain.h"
#include "datasets/io/exif.h"
#include "datasets/io/gopro_gps.h"
#include "datasets/io/lines.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct DatasetCamera {
  fs::path dir;                                         // its pictures lie below it
  std::vector<std::pair<int64_t, std::string>> images;  // time, file below `dir`
  std::optional<BodyCamera> calibration;
};

struct Dataset {
  std::vector<DatasetCamera> cameras;
  bool camera_poses = false;     // poses of a file are of the first camera, not of the body
  fs::path times;                // of KITTI's poses
  fs::path truth;                // ground truth of the folder, or empty
  std::vector<TimedPose> poses;  // odometry of the folder
  bool levelled = false;         // their z axis is vertical
};

fs::path EurocRoot(const fs::path& folder) { return fs::exists(folder / "mav0") ? folder / "mav0" : folder; }

// `time, file` lines, separated by commas or spaces.
std::vector<std::pair<int64_t, std::string>> ReadImageTimes(const fs::path& file) {
  std::vector<std::pair<int64_t, std::string>> images;
  const std::string text = ReadTextFile(file);
  for (const auto& [line, number] : DataLines(text)) {
    const size_t gap = line.find_first_of(", \t");
    const std::string name(gap == std::string_view::npos ? "" : Trim(line.substr(gap + 1)));
    const fs::path normal = fs::path(name).lexically_normal();
    if (name.empty() || normal.is_absolute() || *normal.begin() == "..") {
      throw InputError(FileLine(file, number) + ": expected 'time file', the file below " +
                       file.parent_path().string() + ", found '" + std::string(line.substr(0, 100)) + "'");
    }
    try {
      images.emplace_back(ParseSecondsToNs(line.substr(0, gap)), name);
    } catch (const InputError& e) {
      throw InputError(FileLine(file, number) + ": " + e.what());
    }
  }
  return images;
}

// sensor.yaml: OpenCV's kind of YAML, with T_BS = body_from_camera.
BodyCamera EurocCamera(const fs::path& file, const std::string& name) {
  const YamlMap map = YamlMap::AnyKeys(file, ParseYaml(file, ReadTextFile(file)));
  const std::vector<double> f = map.Numbers("intrinsics", 4), size = map.Numbers("resolution", 2),
                            t = map.MapOfAnyKeys("T_BS").Numbers("data", 16);
  std::string model = map.Text("distortion_model");
  if (model == "radial-tangential") model = "radtan";
  BodyCamera camera;
  camera.name = name;
  camera.camera =
      OpenCvCamera(file.string(), {f[0], 0, f[2], 0, f[1], f[3], 0, 0, 1}, map.Numbers("distortion_coefficients"),
                   model, static_cast<int>(size[0]), static_cast<int>(size[1]));
  try {
    camera.cam_from_body =
        RigidFromMatrix(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(t.data())).Inverse();
  } catch (const InputError& e) {
    map.Fail("T_BS", e.what());
  }
  camera.has_extrinsics = true;
  return camera;
}

Dataset ReadEuroc(const fs::path& folder) {
  const fs::path root = EurocRoot(folder);
  Dataset dataset;
  for (int i = 0; fs::exists(root / fmt::format("cam{}", i) / "sensor.yaml"); ++i) {
    const fs::path dir = root / fmt::format("cam{}", i);
    dataset.cameras.push_back(
        {dir / "data", ReadImageTimes(dir / "data.csv"), EurocCamera(dir / "sensor.yaml", fmt::format("cam{}", i))});
  }
  dataset.truth = root / "state_groundtruth_estimate0" / "data.csv";
  return dataset;
}

BodyCamera ForwardCamera(const std::string& name, Camera camera) {
  return {.name = name, .camera = std::move(camera), .cam_from_body = LevelForwardCamera(), .has_extrinsics = true};
}

Dataset ReadTumRgbd(const fs::path& folder) {
  // The calibrations that the data set's page states for the colour cameras; those of freiburg3 are undistorted.
  static const std::map<std::string, std::vector<double>> kCameras = {
      {"freiburg1", {517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
      {"freiburg2", {520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172}},
      {"freiburg3", {535.4, 539.2, 320.1, 247.6}}};
  Dataset dataset;
  dataset.camera_poses = true;
  dataset.truth = folder / "groundtruth.txt";
  DatasetCamera& camera = dataset.cameras.emplace_back();
  camera.dir = folder;
  camera.images = ReadImageTimes(folder / "rgb.txt");
  for (const auto& [name, p] : kCameras) {
    if (fs::absolute(folder).string().find(name) == std::string::npos) continue;
    camera.calibration =
        ForwardCamera("cam0", {p.size() > 4 ? CameraModel::kRadtan : CameraModel::kPinhole, 640, 480, p});
  }
  return dataset;
}

// Rows "P0: 12 numbers" of calib.txt.
std::map<std::string, std::vector<double>> ReadProjections(const fs::path& file) {
  std::map<std::string, std::vector<double>> projections;
  const std::string text = ReadTextFile(file);
  int number = 0;
  for (const std::string_view line : Lines(text)) {
    ++number;
    const std::vector<std::string_view> fields = SplitFields(Trim(line));
    if (fields.size() != 13) continue;
    const std::string name(fields[0].substr(0, fields[0].find(':')));
    std::vector<double>& values = projections[name];
    for (size_t i = 1; i < 13; ++i) {
      const auto value = ParseDouble(fields[i]);
      if (!value || !std::isfinite(*value)) {
        throw InputError(FileLine(file, number) + ": row '" + name + "': expected 12 numbers, found '" +
                         Excerpt(fields[i]) + "'");
      }
      values.push_back(*value);
    }
  }
  return projections;
}

// A stereo pair of rectified cameras: the grey one, else the coloured one.
Dataset ReadKitti(const fs::path& folder) {
  Dataset dataset;
  dataset.camera_poses = true;
  dataset.times = folder / "times.txt";
  const auto projections = ReadProjections(folder / "calib.txt");
  const int first = fs::exists(folder / "image_0") ? 0 : 2;
  std::vector<int64_t> stamps;
  const std::string times = ReadTextFile(dataset.times);
  for (std::string_view field : SplitFields(times)) stamps.push_back(ParseSecondsToNs(field));
  Rigid3d first_from_reference;
  for (int i = first; i < first + 2 && fs::exists(folder / fmt::format("image_{}", i)); ++i) {
    const auto p = projections.find(fmt::format("P{}", i));
    if (p == projections.end() || !(p->second[0] > 0) || !(p->second[5] > 0)) {
      throw InputError((folder / "calib.txt").string() + fmt::format(": expected a row 'P{}:' of 12 numbers", i));
    }
    const std::vector<double>& m = p->second;
    DatasetCamera camera;
    camera.dir = folder / fmt::format("image_{}", i);
    for (size_t k = 0; k < stamps.size(); ++k) camera.images.emplace_back(stamps[k], fmt::format("{:06d}.png", k));
    const PhotoMetadata size = ReadPhotoMetadata(camera.dir / camera.images.at(0).second);
    BodyCamera calibration = ForwardCamera(fmt::format("cam{}", i - first),
                                           {CameraModel::kPinhole, size.width, size.height, {m[0], m[5], m[2], m[6]}});
    // P = K [I | t], t from camera 0, whose poses are given.
    const Eigen::Vector3d t((m[3] - m[2] * m[11]) / m[0], (m[7] - m[6] * m[11]) / m[5], m[11]);
    calibration.cam_from_body = Rigid3d(Eigen::Quaterniond::Identity(), t) * calibration.cam_from_body;
    camera.calibration = std::move(calibration);
    dataset.cameras.push_back(std::move(camera));
  }
  return dataset;
}

// A pose in a world whose y is up of a phone whose axes are x right, y up, z backwards (ARKit's camera, ARCore's sensor
// frame with the phone upright), as odometry: z up, the body looking along x.
Rigid3d BodyFromPhone(const Rigid3d& world_from_phone) {
  const Rigid3d up(Eigen::Quaterniond(Eigen::AngleAxisd(EIGEN_PI / 2, Eigen::Vector3d::UnitX())),
                   Eigen::Vector3d::Zero());
  const Rigid3d phone_from_cam(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  return up * world_from_phone * phone_from_cam * LevelForwardCamera();
}

bool IsPhoneLog(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.ends_with("ARCore_sensor_pose.txt") || name.ends_with("ARKit_camera_pose.txt");
}

constexpr double kUnitTolerance = 1e-2;  // of numbers written with few digits

// Throws InputError "where: ..." for what is no rotation.
Eigen::Quaterniond UnitRotation(const std::string& where, const Eigen::Quaterniond& q) {
  if (!(std::abs(q.norm() - 1) < kUnitTolerance)) {
    throw InputError(fmt::format("{}: expected a unit quaternion, found one of length {:.4g}", where, q.norm()));
  }
  return q.normalized();
}

Eigen::Quaterniond RotationOf(const std::string& where, const Eigen::Matrix3d& r) {
  if (!((r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < kUnitTolerance) || r.determinant() < 0) {
    throw InputError(where + ": expected the rows of [R | t], found an R that is no rotation");
  }
  return Eigen::Quaterniond(r).normalized();
}

// Doubled times are dropped with a warning where the run is read.
void RequireLater(const std::string& where, int64_t stamp_ns, const std::vector<TimedPose>& before) {
  if (before.empty() || stamp_ns >= before.back().stamp_ns) return;
  throw InputError(where + ": expected a time not before that of the pose before, found one " +
                   FormatNsAsSeconds(before.back().stamp_ns - stamp_ns, 6) + " s earlier; the log is out of order");
}

// What the apps ARCore-Data-Logger (timestamp_ns, qx, qy, qz, qw, tx, ty, tz) and ARKit-Data-Logger (timestamp_ns, then
// the rows of [R | t]) write, as their pages on GitHub describe it. The first pose is at time 0.
std::vector<TimedPose> ReadPhoneLog(const fs::path& file) {
  const std::string text = ReadTextFile(file);
  std::vector<TimedPose> poses;
  double first_ns = 0;
  for (const auto& [line, number] : DataLines(text)) {
    const std::string where = FileLine(file, number);
    std::vector<double> v;
    for (const std::string_view field : SplitAt(line, ',')) v.push_back(ParseDouble(field).value_or(NAN));
    const bool numbers = std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
    if (!numbers || (v.size() != 8 && v.size() != 13)) {
      throw InputError(where + ": expected a time in ns and 7 (ARCore) or 12 (ARKit) numbers of a pose");
    }
    Rigid3d pose;
    if (v.size() == 8) {
      pose = Rigid3d(UnitRotation(where, {v[4], v[1], v[2], v[3]}), {v[5], v[6], v[7]});
    } else {
      const Eigen::Matrix<double, 3, 4> m = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(&v[1]);
      pose = Rigid3d(RotationOf(where, m.leftCols<3>()), m.col(3));
    }
    if (poses.empty()) first_ns = v[0];
    const int64_t stamp = std::llround(v[0] - first_ns);
    RequireLater(where, stamp, poses);
    poses.push_back({stamp, BodyFromPhone(pose)});
  }
  if (poses.empty()) throw InputError(file.string() + ": no pose");
  return poses;
}

// Record3D's recording, unpacked (.r3d is a zip): metadata (JSON) and rgbd/<n>.jpg, with ARKit's pose of each picture
// (x right, y up, z backwards, in a world whose y is up) as [qx, qy, qz, qw, x, y, z] and K by columns.
Dataset ReadRecord3d(const fs::path& folder) {
  const fs::path file = folder / "metadata";
  const nlohmann::json metadata = nlohmann::json::parse(ReadTextFile(file), nullptr, false);
  Dataset dataset;
  dataset.levelled = true;
  DatasetCamera& camera = dataset.cameras.emplace_back();
  camera.dir = folder / "rgbd";
  try {
    const auto k = metadata.at("K").get<std::vector<double>>();
    const auto poses = metadata.at("poses").get<std::vector<std::vector<double>>>();
    std::vector<double> times;
    if (metadata.contains("frameTimestamps")) {
      metadata.at("frameTimestamps").get_to(times);
    } else {  // recordings of early versions
      const auto fps = metadata.at("fps").get<double>();
      if (!(fps > 0.01 && fps < 1000)) throw InputError(fmt::format("expected fps above 0, found {:g}", fps));
      for (size_t i = 0; i < poses.size(); ++i) times.push_back(static_cast<double>(i) / fps);
    }
    if (k.size() != 9 || times.size() != poses.size()) {
      throw InputError(
          fmt::format("expected 9 numbers in K and one time for each pose, found {} numbers, {} times, {} poses",
                      k.size(), times.size(), poses.size()));
    }
    camera.calibration = ForwardCamera(
        "cam0",
        {CameraModel::kPinhole, metadata.at("w").get<int>(), metadata.at("h").get<int>(), {k[0], k[4], k[6], k[7]}});
    const auto pictures = static_cast<size_t>(std::count_if(
        fs::directory_iterator(camera.dir), {}, [](const auto& e) { return e.path().extension() == ".jpg"; }));
    if (pictures != poses.size()) {
      throw InputError(
          fmt::format("{} poses, but {} has {} pictures; expected one pose for each: unpack the .r3d again",
                      poses.size(), camera.dir.string(), pictures));
    }
    for (size_t i = 0; i < poses.size(); ++i) {
      const std::vector<double>& p = poses[i];
      if (p.size() != 7 || !std::isfinite(times[i])) throw InputError("expected poses of 7 numbers and finite times");
      const std::string which = fmt::format("pose {} of {}", i, poses.size());
      const int64_t stamp = std::llround(times[i] * 1e9);
      camera.images.emplace_back(stamp, fmt::format("{}.jpg", i));
      if (!std::all_of(p.begin(), p.end(), [](double x) { return std::isfinite(x); })) continue;
      const Rigid3d world_from_arkit(UnitRotation(which, {p[3], p[0], p[1], p[2]}), {p[4], p[5], p[6]});
      RequireLater(which, stamp, dataset.poses);
      dataset.poses.push_back({stamp, BodyFromPhone(world_from_arkit)});
    }
  } catch (const InputError& e) {
    throw InputError(file.string() + ": " + e.what());
  } catch (const nlohmann::json::exception&) {
    throw InputError(file.string() + ": expected Record3D's metadata: K, w, h, poses, frameTimestamps or fps");
  }
  return dataset;
}

// KITTI's, with the folder's times, or others.
Trajectory ReadPoses(const fs::path& file, const fs::path& times) {
  if (!HasKittiRows(ReadTextFile(file))) return ReadTrajectory(file);
  if (times.empty()) throw InputError(file.string() + ": KITTI's poses have no times; expected rows with times");
  return ReadKittiTrajectory(file, times);
}

// The file's poses, else the folder's own.
void WriteDatasetOdometry(Dataset dataset, const fs::path& file, const fs::path& dir, ImportReport* report) {
  std::string source = "the folder";
  if (IsPhoneLog(file)) {
    dataset.poses = ReadPhoneLog(file);
    source = file.filename().string();
    report->warnings.push_back(source +
                               " is on the phone's own clock: its first pose is taken at the first image; if they were "
                               "not started together, correct odometry: time_offset_s in run.yaml");
  } else if (!file.empty()) {
    Trajectory trajectory = ReadPoses(file, dataset.times);
    dataset.poses = std::move(trajectory.poses);
    source = file.filename().string();
    report->warnings.insert(report->warnings.end(), trajectory.warnings.begin(), trajectory.warnings.end());
    // The body of a camera without another one looks along x.
    if (dataset.camera_poses) {
      for (TimedPose& pose : dataset.poses) pose.target_from_body = pose.target_from_body * LevelForwardCamera();
    }
  } else if (dataset.levelled) {
    WriteFileAtomically(dir / "run.yaml", "odometry: {levelled: true}\n");
  }
  report->lines.push_back(dataset.poses.empty()
                              ? "no odometry: name a file of poses by --odometry"
                              : "odometry: " + Counted(dataset.poses.size(), "pose") + " from " + source);
  if (!dataset.poses.empty()) WriteTum(dir / "odometry.tum", dataset.poses, {"from " + source});
}

void ListFiles(const fs::path& dir, ImportReport* report) {
  for (const auto& entry : fs::directory_iterator(dir)) report->files.push_back(entry.path());
  std::sort(report->files.begin(), report->files.end());
}

}  // namespace

bool IsInsta360File(const fs::path& file) {
  const std::string ending = LowerExtension(file);
  return ending == ".insv" || ending == ".insp";
}

std::string DatasetKind(const fs::path& folder) {
  const auto has = [](const fs::path& file) {
    std::error_code ignored;
    return fs::exists(file, ignored);
  };
  if (has(EurocRoot(folder) / "cam0" / "sensor.yaml")) return "euroc";
  if (has(folder / "rgb.txt")) return "tum-rgbd";
  const bool images = has(folder / "image_0") || has(folder / "image_2");
  if (has(folder / "metadata") && has(folder / "rgbd")) return "record3d";
  return images && has(folder / "times.txt") && has(folder / "calib.txt") ? "kitti" : "";
}

namespace {

Dataset ReadDataset(const fs::path& folder) {
  const std::string kind = DatasetKind(folder);
  if (kind.empty()) {
    throw InputError(folder.string() + ": expected a folder of EuRoC, TUM RGB-D, KITTI odometry or Record3D");
  }
  RequireAllInside(folder);
  return kind == "euroc"      ? ReadEuroc(folder)
         : kind == "kitti"    ? ReadKitti(folder)
         : kind == "record3d" ? ReadRecord3d(folder)
                              : ReadTumRgbd(folder);
}

void RefuseInsta360File(const fs::path& video) {
  if (!IsInsta360File(video)) return;
  throw InputError(video.string() +
                   ": Insta360's own file holds two fisheye pictures and telemetry in a form that is not published; "
                   "export the video (MP4) and its GPX from Insta360 Studio, put both beside each other under one "
                   "name, and import the MP4");
}

fs::path TrackBeside(const fs::path& video) {
  for (const char* ending : {".gpx", ".nmea"}) {
    const fs::path beside = fs::path(video).replace_extension(ending);
    if (!fs::exists(beside)) continue;
    RequireInside(video.parent_path(), beside);
    return beside;
  }
  return {};
}

}  // namespace

std::string DescribeDataset(const fs::path& folder) {
  const Dataset dataset = ReadDataset(folder);
  size_t images = 0, calibrated = 0;
  for (const DatasetCamera& camera : dataset.cameras) {
    images += camera.images.size();
    calibrated += camera.calibration ? 1 : 0;
  }
  return fmt::format(
      "{}: {} of {}, {} calibrated; odometry: {}{}", DatasetKind(folder), Counted(images, "image"),
      Counted(dataset.cameras.size(), "camera"), calibrated,
      dataset.poses.empty() ? "none in it, name a file of poses by --odometry" : Counted(dataset.poses.size(), "pose"),
      fs::exists(dataset.truth) ? "; ground truth: " + dataset.truth.string() : "");
}

std::string DescribeVideo(const fs::path& video) {
  RefuseInsta360File(video);
  const fs::path track = TrackBeside(video);
  return "video, " + (track.empty() ? "no track of its name beside it" : "track " + track.filename().string());
}

ImportReport ImportDatasetRun(const fs::path& site, const fs::path& folder, const DatasetRunOptions& options) {
  if (options.every < 1) throw OptionError("--every: expected 1 or more, found " + std::to_string(options.every));
  RunFolder run(site, options.run);
  const std::string kind = DatasetKind(folder);
  Dataset dataset = ReadDataset(folder);
  ImportReport report;
  std::vector<BodyCamera> cameras;
  if (!options.cameras.empty()) cameras = ReadCamerasFor(options.cameras, dataset.cameras.size(), folder.string());
  std::vector<RunImage> images;
  fs::create_directories(run.dir() / "images");
  for (size_t i = 0; i < dataset.cameras.size(); ++i) {
    const DatasetCamera& camera = dataset.cameras[i];
    const std::string name = fmt::format("cam{}", i);
    fs::create_directory_symlink(fs::canonical(camera.dir), run.dir() / "images" / name);
    for (size_t k = 0; k < camera.images.size(); k += static_cast<size_t>(options.every)) {
      const auto& [stamp, file] = camera.images[k];
      images.push_back({stamp, "images/" + name + "/" + file, name});
    }
    if (options.cameras.empty() && camera.calibration) cameras.push_back(*camera.calibration);
  }
  if (images.empty()) throw InputError(folder.string() + ": no image is listed");
  if (cameras.size() == dataset.cameras.size()) {
    WriteCamchain(run.dir() / "camchain.yaml", cameras,
                  {"cameras of " + folder.filename().string() + " (" + kind + ")"});
  } else {
    report.warnings.push_back("the calibration of these cameras is not known; name one by --cameras");
    for (RunImage& image : images) image.camera.clear();
  }
  WriteImageList(run.dir(), images, "from " + folder.string());
  report.lines.push_back(
      fmt::format("{}: {} of {}", kind, Counted(images.size(), "image"), Counted(dataset.cameras.size(), "camera")));
  WriteDatasetOdometry(dataset, options.odometry, run.dir(), &report);
  if (fs::exists(dataset.truth))
    report.lines.push_back("ground truth, for `trigpoint trajectory`: " + dataset.truth.string());
  ListFiles(run.Complete(), &report);
  return report;
}

namespace {

// The last bytes of files of Insta360's cameras, behind what their telemetry is in.
bool HasInsta360Telemetry(const fs::path& video) {
  constexpr std::string_view kMark = "8db42d694ccc418790edff439fe026bf";
  std::ifstream in(video, std::ios::binary);
  std::string end(kMark.size(), ' ');
  in.seekg(-static_cast<std::streamoff>(kMark.size()), std::ios::end);
  in.read(end.data(), static_cast<std::streamsize>(end.size()));
  return in && end == kMark;
}

// The video's beginning in UTC, as run.yaml has it; "" without a track, which is on UTC.
std::string VideoStart(const fs::path& video, const fs::path& track, ImportReport* report) {
  if (track.empty()) return "";
  const std::vector<GpsFix> fixes = track.extension() == ".gpx" ? ReadGpx(track, {}).fixes : ReadNmea(track, {}).fixes;
  if (fixes.empty()) throw InputError(track.string() + ": no position with a time");
  std::optional<int64_t> start = VideoCreationUtcNs(video);
  constexpr int64_t kApart_ns = int64_t{3600} * 1'000'000'000;
  const std::string name = video.filename().string(), gps = track.filename().string();
  if (start && *start > fixes.front().stamp_ns - kApart_ns && *start < fixes.back().stamp_ns + kApart_ns) {
    report->lines.push_back(
        "time: the video is taken to begin at its creation time; if that is its end, correct time_zero_utc "
        "in run.yaml");
  } else {
    report->warnings.push_back(name + " states no start time that fits " + gps +
                               " (within 1 h): taken as its first time; correct time_zero_utc in run.yaml if the two "
                               "were not started together");
    start = fixes.front().stamp_ns;
  }
  return fmt::format("time_zero_utc: {:%Y-%m-%dT%H:%M:%S}.{:03}Z\n",
                     fmt::gmtime(static_cast<std::time_t>(*start / 1'000'000'000)), *start / 1'000'000 % 1000);
}

}  // namespace

ImportReport ImportVideoRun(const fs::path& site, const fs::path& video, const DatasetRunOptions& options) {
  if (options.every < 1) throw OptionError("--every: expected 1 or more, found " + std::to_string(options.every));
  RefuseInsta360File(video);
  RunFolder run(site, options.run);
  ImportReport report;
  const fs::path track = TrackBeside(video);
  fs::create_symlink(fs::canonical(video), run.dir() / video.filename());
  if (!track.empty()) fs::copy_file(track, run.dir() / track.filename());
  WriteFileAtomically(run.dir() / "run.yaml", "# From " + video.filename().string() + ".\n" +
                                                  VideoStart(video, track, &report) +
                                                  (IsPhoneLog(options.odometry) ? "odometry: {levelled: true}\n" : "") +
                                                  fmt::format("video: {{every: {}}}\n", options.every));
  if (!options.cameras.empty()) {
    WriteCamchain(run.dir() / "camchain.yaml", ReadCamerasFor(options.cameras, 1, "a video"),
                  {"from " + options.cameras.string()});
  } else {
    report.warnings.push_back("the calibration of the camera is not known; name one by --cameras");
  }
  report.lines.push_back("video " + video.filename().string() +
                         (track.empty() ? "" : ", GPS " + track.filename().string()));
  if (track.empty() && HasInsta360Telemetry(video)) {
    report.warnings.push_back(
        video.filename().string() +
        ": the telemetry of Insta360 is in a form that is not published and is not read; export the "
        "GPX from Insta360 Studio and put it beside the video under its name");
  }
  if (!options.odometry.empty()) WriteDatasetOdometry({}, options.odometry, run.dir(), &report);
  ListFiles(run.Complete(), &report);
  return report;
}

}  // namespace trigpoint
