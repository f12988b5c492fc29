#include <algorithm>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"
#include "datasets/io/exif.h"
#include "datasets/io/gps.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

RunConfig ReadRunConfig(const std::filesystem::path& file) {
  RunConfig config;
  if (!std::filesystem::exists(file)) return config;
  const YamlMap map(file, LoadYaml(file),
                    {"date", "role", "camera", "mirrored", "masks", "time_zero_utc", "gps", "odometry", "video"});
  config.date = map.Text("date");
  if (!config.date.empty() && !ParseUtcToNs(config.date)) {
    map.Fail("date", "expected a date as 2026-05-12, found '" + config.date + "'");
  }
  config.role = map.Text("role", config.role);
  const std::vector<std::string> roles = {"survey", "evaluation", "both"};
  if (std::find(roles.begin(), roles.end(), config.role) == roles.end()) {
    map.Fail("role", "expected survey, evaluation or both, found '" + config.role + "'; nearest: '" +
                         NearestName(config.role, roles) + "'");
  }
  config.camera = map.Text("camera");
  config.mirrored = map.Bool("mirrored", config.mirrored);
  if (map.Has("masks") && map.Node("masks").IsScalar()) {
    config.masks[""] = map.Text("masks");  // one for all cameras
  } else {
    const YamlMap masks = map.MapOfAnyKeys("masks");
    for (const std::string& camera : masks.Keys()) config.masks[camera] = masks.Text(camera);
  }
  if (map.Has("time_zero_utc")) {
    config.time_zero_utc_ns = ParseUtcToNs(map.Text("time_zero_utc"));
    if (!config.time_zero_utc_ns) {
      map.Fail("time_zero_utc", "expected a time as 2026-05-12T09:43:20Z, found '" + map.Text("time_zero_utc") + "'");
    }
  }
  const YamlMap gps = map.Map("gps", {"lever_arm_m", "time_offset_s"});
  if (gps.Has("lever_arm_m"))
    config.gps_lever_arm_m = Eigen::Map<const Eigen::Vector3d>(gps.Numbers("lever_arm_m", 3).data());
  config.gps_time_offset_s = gps.Number("time_offset_s", 0);
  const YamlMap odometry = map.Map("odometry", {"levelled", "scale_sigma", "time_offset_s"});
  config.odometry_levelled = odometry.Bool("levelled", config.odometry_levelled);
  config.odometry_scale_sigma = odometry.Number("scale_sigma", config.odometry_scale_sigma);
  if (config.odometry_scale_sigma < 0) odometry.Fail("scale_sigma", "expected 0 or more");
  config.odometry_time_offset_s = odometry.Number("time_offset_s", 0);
  const YamlMap video = map.Map("video", {"start_s", "every"});
  config.video_start_s = video.Number("start_s", 0);
  config.video_every = video.Integer("every", config.video_every);
  if (config.video_every < 1) video.Fail("every", "expected 1 or more");
  return config;
}

// The calibration that run.yaml names; empty without one.
std::filesystem::path CalibrationFile(const std::filesystem::path& site_dir, const Run& run) {
  if (run.config.camera.empty()) return {};
  const std::string yaml = (run.dir / "run.yaml").string() + ": key 'camera'";
  const std::filesystem::path calibrations = site_dir / "results" / "calibrate";
  const std::filesystem::path file =
      ResolveInside(calibrations, calibrations, run.config.camera + "/camchain.yaml", yaml);
  if (std::filesystem::exists(file)) return file;
  if (std::filesystem::exists(file.parent_path() / "camchain_refused.yaml")) {
    throw InputError(yaml + ": the calibration '" + run.config.camera + "' was refused; " +
                     (file.parent_path() / "quality.md").string() + " says why and what to photograph next");
  }
  throw InputError(yaml + ": there is no calibration '" + run.config.camera + "' (" + file.string() +
                   "); run `trigpoint calibrate` with --name " + run.config.camera + " first");
}

// The calibration named in run.yaml, else the run's own camchain.yaml. How the cameras sit on the body is the run's
// where the calibration doesn't say; how a calibrated rig's cameras sit to each other is the calibration's.
std::vector<BodyCamera> ReadCameras(const std::filesystem::path& site_dir, const Run& run) {
  const std::filesystem::path own = run.dir / "camchain.yaml";
  std::vector<BodyCamera> mounted;
  if (std::filesystem::exists(own)) mounted = ReadCamchain(own);
  const std::filesystem::path calibration = CalibrationFile(site_dir, run);
  if (calibration.empty()) return mounted;
  std::vector<BodyCamera> cameras = ReadCamchain(calibration);
  if (cameras.front().has_extrinsics || mounted.empty()) return cameras;
  const auto same = std::find_if(mounted.begin(), mounted.end(),
                                 [&](const BodyCamera& camera) { return camera.name == cameras.front().name; });
  const BodyCamera& first = same != mounted.end() ? *same : mounted.front();
  const Rigid3d moved = cameras.front().cam_from_body.Inverse() * first.cam_from_body;
  for (BodyCamera& camera : cameras) {
    if (camera.has_extrinsics) continue;
    camera.cam_from_body = camera.cam_from_body * moved;
    camera.has_extrinsics = first.has_extrinsics;
    for (const BodyCamera& other : mounted) {
      if (other.name == camera.name) camera.time_offset_s = other.time_offset_s;
    }
  }
  return cameras;
}

void AssignMasks(const std::filesystem::path& site_dir, Run* run) {
  const std::string yaml = (run->dir / "run.yaml").string() + ": key 'masks'";
  for (const auto& [name, written] : run->config.masks) {
    const std::filesystem::path path = ResolveInside(site_dir, run->dir, written, yaml);
    CheckPresent(path, yaml);
    bool found = false;
    for (BodyCamera& camera : run->cameras) {
      if (!name.empty() && camera.name != name) continue;
      camera.mask = path;
      found = true;
    }
    if (!found && !run->cameras.empty()) {
      std::vector<std::string> names;
      for (const BodyCamera& camera : run->cameras) names.push_back(camera.name);
      throw InputError(yaml + ": there is no camera '" + name + "'; nearest: '" + NearestName(name, names) + "'");
    }
  }
}

int64_t ToNs(double seconds) { return std::llround(seconds * 1e9); }

void ReadOdometry(Run* run) {
  for (const char* name : {"odometry.tum", "odometry.txt", "odometry.csv"}) {
    const std::filesystem::path file = run->dir / name;
    if (!std::filesystem::exists(file)) continue;
    run->odometry = ReadTrajectory(file);
    for (TimedPose& pose : run->odometry.poses) pose.stamp_ns += ToNs(run->config.odometry_time_offset_s);
    run->warnings.insert(run->warnings.end(), run->odometry.warnings.begin(), run->odometry.warnings.end());
    return;
  }
}

std::optional<std::filesystem::path> GpsFile(const std::filesystem::path& dir) {
  if (std::filesystem::exists(dir / "gps.csv")) return dir / "gps.csv";
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(dir)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".nmea" || extension == ".gpx") files.push_back(entry.path());
  }
  if (files.empty()) return std::nullopt;
  return *std::min_element(files.begin(), files.end());
}

// GPS is a help, not a need: a broken track is left out with its reason.
void ReadGps(Run* run) {
  const auto file = GpsFile(run->dir);
  if (!file) return;
  try {
    const RunClock clock{run->config.time_zero_utc_ns, run->config.date};
    GpsTrack track = file->extension() == ".csv"    ? ReadGpsCsv(*file)
                     : file->extension() == ".nmea" ? ReadNmea(*file, clock)
                                                    : ReadGpx(*file, clock);
    for (GpsFix& fix : track.fixes) fix.stamp_ns += ToNs(run->config.gps_time_offset_s);
    run->gps = std::move(track.fixes);
    run->warnings.insert(run->warnings.end(), track.warnings.begin(), track.warnings.end());
  } catch (const InputError& e) {
    run->warnings.push_back(std::string(e.what()) + "; the run goes on without GPS");
  }
}

// What the times of the streams say about each other.
void CompareTimes(Run* run) {
  if (run->images.empty()) return;
  const int64_t first = run->images.front().stamp_ns, last = run->images.back().stamp_ns;
  const auto span = [](int64_t a, int64_t b) {
    return FormatNsAsSeconds(a, 3) + " to " + FormatNsAsSeconds(b, 3) + " s";
  };
  if (!run->odometry.poses.empty()) {
    const int64_t begin = run->odometry.poses.front().stamp_ns, end = run->odometry.poses.back().stamp_ns;
    const auto covered = std::count_if(run->images.begin(), run->images.end(), [&](const ImageEntry& image) {
      return image.stamp_ns >= begin && image.stamp_ns <= end;
    });
    if (covered < static_cast<std::ptrdiff_t>(run->images.size())) {
      run->warnings.push_back(run->dir.string() + ": odometry covers " + std::to_string(covered) + " of " +
                              std::to_string(run->images.size()) + " images (odometry " + span(begin, end) +
                              ", images " + span(first, last) + ")");
    }
  }
  if (!run->gps.empty() && (run->gps.back().stamp_ns < first || run->gps.front().stamp_ns > last)) {
    run->warnings.push_back(run->dir.string() + ": no GPS fix falls into the images' time (GPS " +
                            span(run->gps.front().stamp_ns, run->gps.back().stamp_ns) + ", images " +
                            span(first, last) + "); check time_zero_utc and gps.time_offset_s in run.yaml");
  }
}

}  // namespace

Run ReadRunSettings(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir) {
  Run run;
  run.dir = std::filesystem::absolute(run_dir).lexically_normal();
  if (!run.dir.has_filename()) run.dir = run.dir.parent_path();
  if (!std::filesystem::is_directory(run.dir)) throw InputError(run.dir.string() + ": there is no such run folder");
  run.name = run.dir.filename().string();
  run.config = ReadRunConfig(run.dir / "run.yaml");
  run.cameras = ReadCameras(site_dir, run);
  AssignMasks(site_dir, &run);
  return run;
}

void ReadRunData(const std::filesystem::path& site_dir, Run* run) {
  const std::filesystem::path detections = run->dir / "detections.csv";
  if (std::filesystem::exists(detections)) run->detections = detections;
  ReadImageList(site_dir, run);
  if (run->images.empty() && run->detections.empty()) {
    throw InputError(run->dir.string() + ": no images; expected images.txt, a folder images/, a video, or " +
                     "detections.csv" + (run->warnings.empty() ? "" : ". The first problem: " + run->warnings.front()));
  }
  if (run->cameras.empty() && !run->images.empty() && run->images.front().video_frame < 0) {
    const std::filesystem::path& first = run->images.front().path;
    if (const auto camera = CameraFromMetadata(ReadPhotoMetadata(first))) {
      run->cameras.push_back({"cam0", *camera, {}, false, 0, {}});
      run->warnings.push_back(run->dir.string() + ": no camchain.yaml; focal length from the EXIF of " +
                              first.filename().string() + ", no distortion: calibrate the camera for accuracy");
    }
  }
  if (run->cameras.empty()) {
    throw InputError(run->dir.string() + ": no camera; expected camchain.yaml, 'camera: NAME' in run.yaml, or " +
                     "pictures whose EXIF states the focal length");
  }
  ReadOdometry(run);
  ReadGps(run);
  CompareTimes(run);
}

Run ReadRun(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir) {
  Run run = ReadRunSettings(run_dir, site_dir);
  ReadRunData(site_dir, &run);
  return run;
}

}  // namespace trigpoint
