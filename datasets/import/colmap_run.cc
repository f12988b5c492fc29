#include "datasets/import/colmap_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/geometry/alignment.h"
#include "datasets/colmap/database.h"
#include "datasets/colmap/database_cameras.h"
#include "datasets/import/made_files.h"
#include "datasets/import/run_folder.h"
#include "datasets/import/source_links.h"
#include "datasets/io/camchain.h"
#include "datasets/io/exif.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

fs::path NewRunOf(const fs::path& site, const ColmapRunOptions& options) {
  if (options.images.empty())
    throw OptionError("--images is missing: the folder that the model's image names begin in");
  return NewRunPath(site, options.run);
}

// Throws unless every image is there; names the first that is not.
void CheckImages(const std::vector<std::string>& names, const fs::path& images) {
  size_t missing = 0;
  std::string first;
  for (const std::string& name : names) {
    std::error_code error;
    const fs::path normal = fs::path(name).lexically_normal();
    if (normal.is_absolute() || normal.empty() || *normal.begin() == "..") {
      throw InputError("the model names an image '" + Excerpt(name) +
                       "'; expected names below the folder of --images, without ..");
    }
    RequireInside(images, images / name);
    if (!fs::is_regular_file(images / name, error)) {
      if (missing++ == 0) first = name;
    }
  }
  if (missing > 0) {
    throw InputError(fmt::format("{} of {} images are not in {}, the first: {}; name the folder by --images", missing,
                                 names.size(), images.string(), first));
  }
}

using ImageRows = std::vector<std::tuple<int64_t, std::string, std::string>>;  // stamp, file, camera

// images.txt, and the link to the pictures.
void WriteImages(const fs::path& dir, const fs::path& images, const ImageRows& rows, MadeFiles* made,
                 ImportReport* report) {
  std::error_code error;
  made->Making(dir / "images");
  fs::create_directories(dir, error);
  if (!error) fs::create_directory_symlink(fs::canonical(images), dir / "images", error);
  if (error) throw IoError((dir / "images").string() + ": cannot be written: " + error.message());
  std::string text = "# timestamp file camera; numbered one a second by name\n";
  for (const auto& [stamp, file, camera] : rows) {
    text += FormatNsAsSeconds(stamp, 1) + " \"images/" + file + "\" " + camera + "\n";
  }
  WriteFileAtomically(made->Making(dir / "images.txt"), text);
  report->files.insert(report->files.end(), {dir / "images.txt", dir / "images"});
}

struct Scale {
  double metres = 1;
  double sigma = 0.5;  // as a part of itself
  std::string source;
};

// From the positions that the pictures carry, where they are spread far beyond their noise.
std::optional<Scale> ScaleFromExif(const SparseModel& model, const fs::path& images) {
  std::vector<Eigen::Vector3d> centres, places;
  std::optional<LocalFrame> frame;
  double noise = 3;
  for (const ModelImage& image : model.images) {
    PhotoMetadata metadata;
    try {
      metadata = ReadPhotoMetadata(images / image.name);
    } catch (const InputError&) {
      continue;
    }
    if (!metadata.position) continue;
    Geodetic g = *metadata.position;
    g.height_m = metadata.has_height ? g.height_m : 0;
    if (!frame) frame = LocalFrame(g);
    if (metadata.sigma_h_m) noise = *metadata.sigma_h_m;
    centres.push_back(image.cam_from_world.TargetOriginInSource());
    places.push_back(frame->EnuFromGeodetic(g));
  }
  if (places.size() < 3) return std::nullopt;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : places) mean += p / static_cast<double>(places.size());
  double spread = 0;
  for (const Eigen::Vector3d& p : places) spread += (p - mean).squaredNorm();
  try {
    const Sim3d fit = AlignPoints(centres, places, AlignmentKind::kSim3);
    double residual = 0;
    for (size_t i = 0; i < places.size(); ++i) residual += (fit * centres[i] - places[i]).squaredNorm();
    // 1 sigma of the scale: noise over the root of the summed squared distances from the middle.
    const double degrees = std::max(1.0, 3.0 * static_cast<double>(places.size()) - 7);
    const double sigma = std::max(std::sqrt(residual / degrees), 0.3 * noise) / std::sqrt(spread);
    if (!(sigma < 0.2) || !(fit.scale > 0)) return std::nullopt;
    return Scale{fit.scale, sigma, fmt::format("EXIF positions of {} images", places.size())};
  } catch (const NumericError&) {
    return std::nullopt;
  }
}

Scale ScaleOf(const SparseModel& model, const ColmapRunOptions& options, ImportReport* report) {
  if (options.scale) {
    if (!(*options.scale > 0)) throw OptionError("--scale: expected metres per unit of the model, more than 0");
    return {*options.scale, 0.01, "--scale"};
  }
  if (const auto found = ScaleFromExif(model, options.images)) return *found;
  report->warnings.push_back(
      "the model's unit of length is not known and is taken as 1 m: give it by --scale METRES; otherwise panoramas, "
      "tags or GPS must determine the scale (odometry: scale_sigma in run.yaml)");
  return {.source = "an assumption"};
}

using FrameOfImage = std::map<uint32_t, const ModelFrame*>;

// The frames of the model's rig where it is the run's body; empty: each camera is a body of its own.
FrameOfImage RigFrames(const SparseModel& model, ImportReport* report) {
  FrameOfImage frame_of;
  for (const ModelFrame& frame : model.frames) {
    for (uint32_t id : frame.images) frame_of[id] = &frame;
  }
  if (model.rigs.size() == 1 && model.rigs.front().cameras.size() > 1 &&
      std::all_of(model.images.begin(), model.images.end(),
                  [&](const ModelImage& image) { return frame_of.count(image.id) > 0; })) {
    return frame_of;
  }
  if (model.rigs.size() > 1 &&
      std::any_of(model.rigs.begin(), model.rigs.end(), [](const ModelRig& r) { return r.cameras.size() > 1; })) {
    report->warnings.push_back("the model has several rigs; a run has one body, so every camera is taken by itself");
  }
  return {};
}

struct RunCameras {
  std::vector<BodyCamera> cameras;
  std::map<uint32_t, std::string> name_of;  // by COLMAP's id

  void Add(uint32_t id, const Camera& camera, const Rigid3d& cam_from_body) {
    BodyCamera& c = cameras.emplace_back();
    c.name = name_of[id] = fmt::format("cam{}", cameras.size() - 1);
    c.camera = camera;
    c.cam_from_body = cam_from_body;
    c.has_extrinsics = true;
  }
};

// Of the model's rig, scaled to metres; without one (null) each by itself.
RunCameras CamerasOf(const SparseModel& model, const ModelRig* rig, double metres) {
  RunCameras result;
  for (const auto& [id, camera] : model.cameras) {
    if (rig == nullptr) {
      result.Add(id, camera, LevelForwardCamera());
      continue;
    }
    for (const auto& [member, cam_from_rig] : rig->cameras) {
      if (member != id) continue;
      Rigid3d scaled = cam_from_rig;
      scaled.translation *= metres;
      result.Add(id, camera, scaled * LevelForwardCamera());
    }
  }
  return result;
}

struct TimedImages {
  ImageRows rows;                   // by stamp
  std::vector<TimedPose> odometry;  // a pose a frame of the rig, else a pose an image
};

// One a second, in the order of the images.
TimedImages NumberImages(const SparseModel& model, const FrameOfImage& frame_of, const RunCameras& cameras,
                         double metres, const std::string& where) {
  TimedImages result;
  std::map<uint32_t, int64_t> stamp_of_frame;
  for (const ModelImage& image : model.images) {
    int64_t stamp = static_cast<int64_t>(result.odometry.size()) * 1'000'000'000;
    bool fresh = true;
    Rigid3d world_from_body = image.cam_from_world.Inverse() * LevelForwardCamera();
    if (!frame_of.empty()) {
      const ModelFrame& frame = *frame_of.at(image.id);
      std::tie(std::ignore, fresh) = stamp_of_frame.emplace(frame.id, stamp);
      stamp = stamp_of_frame.at(frame.id);
      world_from_body = frame.rig_from_world.Inverse() * LevelForwardCamera();
    }
    world_from_body.translation *= metres;
    if (fresh) result.odometry.push_back({stamp, world_from_body});
    const auto camera = cameras.name_of.find(image.camera_id);
    if (camera == cameras.name_of.end()) {
      throw InputError(fmt::format("{}: image {}: its camera {} belongs to no camera of the rig", where, image.name,
                                   image.camera_id));
    }
    result.rows.emplace_back(stamp, image.name, camera->second);
  }
  std::stable_sort(result.rows.begin(), result.rows.end(),
                   [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); });
  return result;
}

}  // namespace

ImportReport ImportColmapRun(const fs::path& site, const fs::path& model_dir, const ColmapRunOptions& options) {
  ImportReport report;
  const fs::path dir = NewRunOf(site, options);
  RequireFilesInside(model_dir);
  SparseModel model = ReadColmapModel(model_dir);
  if (model.images.empty()) throw InputError(model_dir.string() + ": the model has no image");
  std::sort(model.images.begin(), model.images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  std::vector<std::string> names;
  for (const ModelImage& image : model.images) names.push_back(image.name);
  CheckImages(names, options.images);

  const Scale scale = ScaleOf(model, options, &report);
  const FrameOfImage frame_of = RigFrames(model, &report);
  const RunCameras cameras = CamerasOf(model, frame_of.empty() ? nullptr : &model.rigs.front(), scale.metres);
  const auto [rows, odometry] = NumberImages(model, frame_of, cameras, scale.metres, model_dir.string());
  MadeFiles made;
  WriteImages(dir, options.images, rows, &made, &report);
  WriteCamchain(made.Making(dir / "camchain.yaml"), cameras.cameras,
                {"cameras of the COLMAP model " + model_dir.string()});
  WriteTum(made.Making(dir / "odometry.tum"), odometry,
           {"poses of a COLMAP model, scaled by " + fmt::format("{:.9g}", scale.metres)});
  WriteFileAtomically(
      made.Making(dir / "run.yaml"),
      fmt::format("# Made of a COLMAP model; metres per unit {:.9g}, from {}.\nodometry:\n  levelled: false\n  "
                  "scale_sigma: {:.3g}\n",
                  scale.metres, scale.source, scale.sigma));
  report.files.insert(report.files.end(), {dir / "camchain.yaml", dir / "odometry.tum", dir / "run.yaml"});
  const fs::path kept = site / "models" / options.run;
  if (std::error_code ignored; !fs::exists(kept, ignored)) {
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) made.Making(kept / name);
    WriteColmapModel(model, kept);
    report.files.push_back(kept);
  }
  made.Keep();
  report.lines.push_back("run " + options.run + ": " + Counted(model.images.size(), "image") + ", " +
                         Counted(cameras.cameras.size(), "camera") + ", " + Counted(model.points.size(), "point") +
                         fmt::format("; {:.6g} m per unit (from {}, +- {:.1f} %, 1 sigma)", scale.metres, scale.source,
                                     100 * scale.sigma));
  return report;
}

ImportReport ImportColmapDatabase(const fs::path& site, const fs::path& file, const ColmapRunOptions& options) {
  ImportReport report;
  const fs::path dir = NewRunOf(site, options);
  const ColmapDatabase database = ColmapDatabase::OpenRead(file);
  std::vector<DatabaseImage> images = database.Images();
  if (images.empty()) throw InputError(file.string() + ": the database has no image");
  std::sort(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  std::vector<std::string> names;
  for (const DatabaseImage& image : images) names.push_back(image.name);
  CheckImages(names, options.images);
  RunCameras found;
  for (const auto& [id, camera] : ReadDatabaseCameras(file)) found.Add(id, camera, LevelForwardCamera());
  const std::vector<BodyCamera>& cameras = found.cameras;
  ImageRows rows;
  for (const DatabaseImage& image : images) {
    const auto camera = found.name_of.find(image.camera_id);
    if (camera == found.name_of.end()) {
      throw InputError(fmt::format("{}: image {}: its camera {} is not in the database", file.string(), image.name,
                                   image.camera_id));
    }
    rows.emplace_back(static_cast<int64_t>(rows.size()) * 1'000'000'000, image.name, camera->second);
  }
  MadeFiles made;
  WriteImages(dir, options.images, rows, &made, &report);
  WriteCamchain(made.Making(dir / "camchain.yaml"), cameras, {"cameras of the COLMAP database " + file.string()});
  made.Keep();
  report.files.push_back(dir / "camchain.yaml");
  report.lines.push_back(
      fmt::format("run {}: {}, {}", options.run, Counted(images.size(), "image"), Counted(cameras.size(), "camera")));
  if (cameras.size() > 1) {
    report.warnings.push_back(Counted(cameras.size(), "camera") +
                              " of the database: how they sit to each other is not stored there; each is written as if "
                              "it were alone on its body: correct T_cam_imu in camchain.yaml before odometry is used");
  }
  report.warnings.push_back(
      "the database has no poses: the motion is estimated from the images alone; for poses, add odometry.tum or import "
      "the model");
  return report;
}

}  // namespace trigpoint
