#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdio>
#include <limits>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/io/camchain.h"
#include "datasets/io/exif_positions.h"
#include "datasets/io/gopro_gps.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/lines.h"
#include "datasets/io/mask.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/run_parts.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "datasets/io/video.h"
#include "datasets/io/yaml.h"

namespace trigpoint {
namespace {

// Of phones and action cameras, as a share of the picture's long side, and its 1 sigma, a share of it.
constexpr double kUsualFocal = 0.8, kUnknownFocalSigma = 0.4;

// One path or a list of paths and boxes.
CameraMask ReadMask(const YamlMap& map, const std::string& key) {
  CameraMask mask;
  const YAML::Node node = map.Node(key);
  if (node.IsScalar()) {
    mask.pictures.emplace_back(map.Text(key));
    return mask;
  }
  const auto fail = [&] {
    map.Fail(key,
             "expected the name of a mask or of a folder of masks, or a list of names and of boxes [u0, v0, u1, v1]");
  };
  if (!node.IsSequence()) fail();
  for (const YAML::Node& entry : node) {
    if (entry.IsScalar()) {
      mask.pictures.emplace_back(entry.as<std::string>());
      continue;
    }
    Eigen::Vector4d box;
    if (!entry.IsSequence() || entry.size() != 4) fail();
    for (size_t k = 0; k < 4; ++k) {
      if (!entry[k].IsScalar() || !YAML::convert<double>::decode(entry[k], box(static_cast<Eigen::Index>(k)))) fail();
    }
    if (!box.allFinite() || !(box(0) <= box(2)) || !(box(1) <= box(3))) {
      map.Fail(key, "expected a box [u0, v0, u1, v1] with u0 <= u1 and v0 <= v1");
    }
    mask.boxes_px.push_back(box);
  }
  return mask;
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
                     (file.parent_path() / "quality.md").string() + " has the reasons and what to photograph next");
  }
  throw InputError(yaml + ": there is no calibration '" + run.config.camera + "' (" + file.string() +
                   "); run `trigpoint calibrate` with --name " + run.config.camera + " first");
}

// The calibration named in run.yaml, else the run's own camchain.yaml. How the cameras sit on the body, and their
// readout times, are the run's where the calibration doesn't say; how a calibrated rig's cameras sit to each other is
// the calibration's.
std::vector<BodyCamera> ReadCameras(const std::filesystem::path& site_dir, const Run& run) {
  const std::filesystem::path own = run.dir / "camchain.yaml";
  std::vector<BodyCamera> mounted;
  if (std::filesystem::exists(own)) mounted = ReadCamchain(own);
  const std::filesystem::path calibration = CalibrationFile(site_dir, run);
  if (calibration.empty()) return mounted;
  std::vector<BodyCamera> cameras = ReadCamchain(calibration);
  for (BodyCamera& camera : cameras) {
    for (const BodyCamera& other : mounted) {
      if (other.name == camera.name && camera.readout_s == 0) camera.readout_s = other.readout_s;
    }
  }
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

void CheckMaskSize(const std::filesystem::path& path, const BodyCamera& camera, const std::string& where) {
  const PhotoMetadata picture = ReadPhotoMetadata(path);
  if (picture.width == camera.camera.width() && picture.height == camera.camera.height()) return;
  throw InputError(where + ": expected a mask of " + std::to_string(camera.camera.width()) + " x " +
                   std::to_string(camera.camera.height()) + " px as camera '" + camera.name + "', found " +
                   path.string() + " of " + std::to_string(picture.width) + " x " + std::to_string(picture.height));
}

std::string WhereMasksAreNamed(const Run& run) { return (run.dir / "run.yaml").string() + ": key 'masks'"; }

// Known before the cameras, as masks may lie among the images of a run whose camera is guessed from its images.
void ResolveMasks(const std::filesystem::path& site_dir, Run* run) {
  const std::string yaml = WhereMasksAreNamed(*run);
  for (auto& [camera, mask] : run->config.masks) {
    for (std::filesystem::path& entry : mask.pictures) {
      entry = ResolveInside(site_dir, run->dir, entry.string(), yaml);
      if (!std::filesystem::is_directory(entry)) CheckPresent(entry, yaml);
    }
  }
}

void AssignMasks(Run* run) {
  const std::string yaml = WhereMasksAreNamed(*run);
  for (const auto& [name, named] : run->config.masks) {
    CameraMask mask;
    mask.boxes_px = named.boxes_px;
    for (const std::filesystem::path& entry : named.pictures) {
      (std::filesystem::is_directory(entry) ? mask.folders : mask.pictures).push_back(entry);
    }
    bool found = false;
    for (BodyCamera& camera : run->cameras) {
      if (!name.empty() && camera.name != name) continue;
      for (const std::filesystem::path& path : mask.pictures) CheckMaskSize(path, camera, yaml);
      camera.mask = mask;
      found = true;
    }
    if (!found && !run->cameras.empty()) {
      std::vector<std::string> names;
      for (const BodyCamera& camera : run->cameras) names.push_back(camera.name);
      throw InputError(yaml + ": there is no camera '" + name + "'; nearest: '" + NearestName(name, names) + "'");
    }
  }
}

// Has a ray, and the ray the same pixel again, all along the picture's edge (but a fisheye's dark corners).
bool CoversItsPicture(const Camera& camera) {
  if (camera.model() != CameraModel::kRadtan && camera.model() != CameraModel::kRational) return true;
  const double w = camera.width() - 1, h = camera.height() - 1;
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), Eigen::Vector2d(w, 0), Eigen::Vector2d(0, h),
                                       Eigen::Vector2d(w, h), Eigen::Vector2d(0, h / 2), Eigen::Vector2d(w, h / 2)}) {
    const auto ray = camera.Unproject(pixel);
    const auto again = ray ? camera.Project(*ray) : std::nullopt;
    if (!again || (*again - pixel).norm() > 0.5) return false;
  }
  return true;
}

constexpr double kMostDecentring = 0.01;  // real lenses: at most a few thousandths

// By how much decentring moves the pixels of the corners, share of half the diagonal.
double DecentringShift(const Camera& camera) {
  const std::vector<double>& p = camera.params();
  if (camera.model() != CameraModel::kRadtan && camera.model() != CameraModel::kRational) return 0;
  return 3 * std::hypot(p[6], p[7]) * 0.5 * std::hypot(camera.width(), camera.height()) / camera.MeanFocal();
}

// Calibrations that no real camera has: a mistyped number, or the parameters of another picture size.
void WarnOfImplausibleCameras(Run* run) {
  for (const BodyCamera& c : run->cameras) {
    const std::vector<double>& p = c.camera.params();
    const double width = c.camera.width(), height = c.camera.height(), longer = std::max(width, height);
    const auto warn = [&](const std::string& what) {
      run->warnings.push_back(run->dir.string() + ": camera '" + c.name + "': " + what + "; check the calibration");
    };
    if (p.size() < 4) continue;
    constexpr double kShortest = 0.15, kLongest = 30;  // of the longer side: 147 deg and 2 deg
    for (int k = 0; k < 2; ++k) {
      if (p[k] < kShortest * longer || p[k] > kLongest * longer) {
        warn(fmt::format("focal length {:g} px for a picture {} px wide; expected {:g} to {:g} times its longer side",
                         p[k], c.camera.width(), kShortest, kLongest));
        break;
      }
    }
    if (std::abs(p[0] / p[1] - 1) > 0.2)
      warn(fmt::format("focal lengths {:g} and {:g} px; expected nearly square pixels", p[0], p[1]));
    if (std::abs(p[2] - 0.5 * width) > 0.3 * width || std::abs(p[3] - 0.5 * height) > 0.3 * height) {
      warn(fmt::format("principal point {:g}, {:g}; expected near the middle {:g}, {:g}", p[2], p[3], 0.5 * (width - 1),
                       0.5 * (height - 1)));
    }
    if (const double shift = DecentringShift(c.camera); shift > kMostDecentring) {
      warn(
          fmt::format("decentring {:g}, {:g} moves pixels in the corners by {:.1f} % of half the diagonal; expected at "
                      "most {:g} %, as coefficients k1, k2, p1, p2 in this order (others write k1, k2, k3, p1, p2)",
                      p[6], p[7], 100 * shift, 100 * kMostDecentring));
    }
    if (!CoversItsPicture(c.camera)) {
      warn(
          "its distortion folds the picture over before the corners, so that pixels there have no ray; expected "
          "coefficients "
          "that hold for the whole picture");
    }
  }
}

int64_t ToNs(double seconds) { return std::llround(seconds * 1e9); }

// The line of a trajectory's file with this stamp.
int LineOfStamp(const std::filesystem::path& file, int64_t stamp_ns) {
  const std::string text = ReadTextFile(file);
  for (const auto& [line, number] : DataLines(text)) {
    try {
      if (ParseSecondsToNs(line.substr(0, line.find_first_of(" \t,"))) == stamp_ns) return number;
    } catch (const InputError&) {  // a header, or a row that was named before
    }
  }
  return 1;
}

// A step far longer than those around it, which no acceleration explains: a correction of the position, or a gap.
bool StandsOut(const std::vector<double>& speeds, const std::vector<TimedPose>& poses, size_t i) {
  constexpr double kLongest_m = 2, kTimes = 8;
  constexpr size_t kAround = 4;
  const double moved = (poses[i + 1].target_from_body.translation - poses[i].target_from_body.translation).norm();
  if (moved < kLongest_m || speeds.size() < 2 * kAround) return false;
  double fastest = 0;
  for (size_t k = i - std::min(i, kAround); k <= std::min(speeds.size() - 1, i + kAround); ++k) {
    if (k != i) fastest = std::max(fastest, speeds[k]);
  }
  return speeds[i] > kTimes * fastest;
}

// No body on the ground moves so: a broken row, or another unit than metres. `times`: the file with the stamps, whose
// rows are those of `file`.
void CheckSpeed(const std::filesystem::path& file, const std::filesystem::path& times, const Trajectory& trajectory) {
  constexpr double kFastest_m_s = 150, kJump = 20;  // a jump: so many times the median speed
  const auto& poses = trajectory.poses;
  std::vector<double> speeds;
  for (size_t i = 1; i < poses.size(); ++i) {
    const double moved = (poses[i].target_from_body.translation - poses[i - 1].target_from_body.translation).norm();
    speeds.push_back(moved / (1e-9 * static_cast<double>(poses[i].stamp_ns - poses[i - 1].stamp_ns)));
  }
  const double median = Median(speeds);
  for (size_t i = 0; i < speeds.size(); ++i) {
    if (speeds[i] <= std::max(kFastest_m_s, kJump * median) && !StandsOut(speeds, poses, i)) continue;
    const double seconds = 1e-9 * static_cast<double>(poses[i + 1].stamp_ns - poses[i].stamp_ns);
    char text[200];
    std::snprintf(text, sizeof text, ": jumps %.1f m in %.3f s; expected a continuous motion in metres",
                  speeds[i] * seconds, seconds);
    throw InputError(FileLine(file, LineOfStamp(times, poses[i + 1].stamp_ns)) + text);
  }
  if (median > kFastest_m_s) {
    throw InputError(file.string() + ": moves at " + std::to_string(std::llround(median)) +
                     " m/s in the median; expected positions in metres and times in seconds");
  }
}

// Coordinates of millions of metres, as those of a map projection, leave no digits for a run: its odometry counts from
// near its first pose then.
void MoveToOrigin(const std::filesystem::path& file, Run* run) {
  constexpr double kFar_m = 1e4;
  if (run->odometry.poses.empty()) return;
  const Eigen::Vector3d first = run->odometry.poses.front().target_from_body.translation.array().round();
  if (first.norm() < kFar_m) return;
  for (TimedPose& pose : run->odometry.poses) pose.target_from_body.translation -= first;
  char text[200];
  std::snprintf(text, sizeof text,
                ": begins %.0f km from its origin; (%.0f, %.0f, %.0f) m is subtracted from its "
                "positions, and coordinates in odometry's frame count from there",
                1e-3 * first.norm(), first.x(), first.y(), first.z());
  run->warnings.push_back(file.string() + text);
}

// Whole metres are what a number format without decimals leaves; no body moves so while it turns.
void CheckDecimals(const std::filesystem::path& file, const Trajectory& trajectory) {
  bool moves = false, turns = false;
  if (trajectory.poses.empty()) return;
  const Rigid3d& first = trajectory.poses.front().target_from_body;
  for (const TimedPose& pose : trajectory.poses) {
    const Eigen::Vector3d& t = pose.target_from_body.translation;
    if (t != t.array().round().matrix()) return;
    moves |= t != first.translation;
    turns |= pose.target_from_body.rotation.coeffs() != first.rotation.coeffs();
  }
  if (moves && turns) {
    throw InputError(file.string() + ": all positions are whole metres; expected metres with at least two decimals");
  }
}

void ReadOdometry(Run* run) {
  for (const char* name : {"odometry.tum", "odometry.txt", "odometry.csv"}) {
    const std::filesystem::path file = run->dir / name;
    if (!std::filesystem::exists(file)) continue;
    const bool kitti = HasKittiRows(ReadTextFile(file));
    const std::filesystem::path times = kitti ? run->dir / "times.txt" : file;
    if (!std::filesystem::exists(times)) {
      throw InputError(file.string() +
                       ": expected times.txt beside it with the time of each row, as these are KITTI's " +
                       "poses without times, found none");
    }
    run->odometry = kitti ? ReadKittiTrajectory(file, times) : ReadTrajectory(file);
    CheckSpeed(file, times, run->odometry);
    CheckDecimals(file, run->odometry);
    for (TimedPose& pose : run->odometry.poses) {
      pose.stamp_ns += ToNs(run->config.odometry_time_offset_s);
      // KITTI's poses are of the first camera.
      if (kitti) {
        pose.target_from_body =
            pose.target_from_body * (run->cameras.empty() ? LevelForwardCamera() : run->cameras.front().cam_from_body);
      }
    }
    run->warnings.insert(run->warnings.end(), run->odometry.warnings.begin(), run->odometry.warnings.end());
    MoveToOrigin(file, run);
    return;
  }
}

// What the camera wrote into the video, on the run's clock.
GpsTrack ReadVideoPositions(const Run& run) {
  GpsTrack track = ReadGoProGps(run.images.front().path);
  for (GpsFix& fix : track.fixes) fix.stamp_ns += ToNs(run.config.video_start_s);
  return track;
}

// GPS is a help, not a need: a broken track is left out with its reason.
void ReadGps(Run* run) {
  const auto file = GpsFile(run->dir);
  try {
    const bool video = !run->images.empty() && run->images.front().video_frame >= 0;
    GpsTrack track = file    ? ReadGpsFile(*file, run->config)
                     : video ? ReadVideoPositions(*run)
                             : ReadImagePositions(*run);
    for (GpsFix& fix : track.fixes) fix.stamp_ns += ToNs(run->config.gps_time_offset_s);
    run->gps = std::move(track.fixes);
    run->warnings.insert(run->warnings.end(), track.warnings.begin(), track.warnings.end());
  } catch (const InputError& e) {
    run->warnings.push_back(std::string(e.what()) + "; the run goes on without GPS");
  }
}

// A receiver without signal may repeat its last fix, number for number, while the body moves on.
void LeaveOutHeldFixes(Run* run) {
  constexpr size_t kLeastFixes = 3;
  constexpr double kSigmas = 3, kLeast_m = 2;
  constexpr int64_t kGap_ns = 60'000'000'000;  // a straight line is good enough to see that it moves
  const std::vector<GpsFix> all = std::move(run->gps);
  run->gps.clear();
  int64_t left_out = 0;
  for (size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    const GpsFix& first = all[begin];
    const auto is_same = [&](const Geodetic& p) {
      return p.latitude_deg == first.position.latitude_deg && p.longitude_deg == first.position.longitude_deg &&
             p.height_m == first.position.height_m;
    };
    double farthest_m = 0;
    std::optional<Rigid3d> from;
    for (; end < all.size() && is_same(all[end].position); ++end) {
      const auto to = run->odometry.At(all[end].stamp_ns, kGap_ns);
      if (!from) from = to;
      if (from && to) farthest_m = std::max(farthest_m, (to->translation - from->translation).norm());
    }
    const bool held = end - begin >= kLeastFixes && farthest_m > std::max(kLeast_m, kSigmas * first.sigma_h_m);
    run->gps.insert(run->gps.end(), all.begin() + static_cast<std::ptrdiff_t>(begin),
                    all.begin() + static_cast<std::ptrdiff_t>(held ? begin + 1 : end));
    left_out += held ? static_cast<int64_t>(end - begin - 1) : 0;
  }
  if (left_out == 0) return;
  run->warnings.push_back(
      fmt::format("{}: {} of GPS repeat the one before number for number while odometry moves on, as a receiver "
                  "without signal does; "
                  "they are left out",
                  run->dir.string(), Counted(left_out, "fix", "fixes")));
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

bool IsTwiceAsWide(const cv::Size& size) { return size.height > 0 && size.width == 2 * size.height; }

// The camera of 360 pictures, by run.yaml or by what the first of them states; none: they are not known as such.
std::optional<Camera> EquirectangularCamera(const Run& run, const std::optional<GPano>& gpano, cv::Size size) {
  const ImageEntry& first = run.images.front();
  const bool video = first.video_frame >= 0;
  const bool stated = video ? IsSphericalVideo(first.path) : gpano && gpano->projection == "equirectangular";
  if (!stated && !run.config.equirectangular) return std::nullopt;
  if (!IsTwiceAsWide(size) && !video) size = LoadPanorama(first.path, true).size();  // a part of the sphere
  if (!IsTwiceAsWide(size) || size.width > std::numeric_limits<uint16_t>::max()) {
    throw InputError(first.path.string() +
                     ": expected an equirectangular picture twice as wide as high, at most 65534 px wide, found " +
                     std::to_string(size.width) + " x " + std::to_string(size.height));
  }
  return Camera::Equirectangular(size.width, size.height);
}

// What a picture's headers state.
struct SampledPicture {
  const ImageEntry* image;
  PhotoMetadata metadata;
  cv::Size Stored() const { return {metadata.width, metadata.height}; }
  cv::Size Shown() const { return metadata.ShownSize(); }
};

// Some of the run's pictures, spread over it: the headers of a long run's take long to read.
std::vector<SampledPicture> SamplePictures(const Run& run) {
  constexpr size_t kSample = 64;
  std::vector<SampledPicture> pictures;
  const size_t step = run.images.size() / kSample + 1;
  for (size_t i = 0; i < run.images.size(); i += step) {
    const ImageEntry& image = run.images[i];
    if (image.video_frame >= 0) continue;
    try {
      pictures.push_back({&image, ReadPhotoMetadata(image.path)});
    } catch (const InputError&) {  // said where the picture is needed
    }
  }
  return pictures;
}

// The size that most pictures have as they are shown or, where some were taken upright and others across, as they are
// stored: LoadPhoto takes either. Of sizes that as many have, that of the first picture.
cv::Size SizeOfMost(const std::vector<SampledPicture>& pictures) {
  std::vector<std::pair<cv::Size, int>> votes;
  const auto vote = [&](const cv::Size& size) {
    auto it = std::find_if(votes.begin(), votes.end(), [&](const auto& known) { return known.first == size; });
    if (it == votes.end()) it = votes.emplace(votes.end(), size, 0);
    ++it->second;
  };
  for (const SampledPicture& picture : pictures) {
    vote(picture.Shown());
    if (picture.Shown() != picture.Stored()) vote(picture.Stored());
  }
  const auto most =
      std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == votes.end() ? cv::Size() : most->first;
}

// Those of this size whose EXIF states a focal length, the shortest first.
std::vector<SampledPicture> WithFocalLength(std::vector<SampledPicture> pictures, const cv::Size& size) {
  std::erase_if(pictures, [&](const SampledPicture& picture) {
    return !picture.metadata.focal_px || (picture.Shown() != size && picture.Stored() != size);
  });
  std::stable_sort(pictures.begin(), pictures.end(), [](const SampledPicture& a, const SampledPicture& b) {
    return *a.metadata.focal_px < *b.metadata.focal_px;
  });
  return pictures;
}

// Phones give the pictures of all their lenses one size.
void WarnOfOtherLenses(const std::vector<SampledPicture>& by_focal, Run* run) {
  const SampledPicture &shortest = by_focal.front(), &longest = by_focal.back();
  if (*longest.metadata.focal_px <= (1 + kExifFocalSigma) * *shortest.metadata.focal_px) return;
  run->warnings.push_back(fmt::format(
      "{}: EXIF states focal lengths from {:.0f} px ({}) to {:.0f} px ({}), but one lens is estimated for all images; "
      "put the images of each lens and zoom into a run of their own",
      run->dir.string(), *shortest.metadata.focal_px, shortest.image->file, *longest.metadata.focal_px,
      longest.image->file));
}

// A camera that nobody calibrated: that of 360 pictures, which need no calibration; else its focal length is by EXIF,
// or that of usual lenses, until the images say better.
void GuessCamera(Run* run) {
  const ImageEntry& first = run->images.front();
  const std::vector<SampledPicture> pictures = SamplePictures(*run);
  cv::Size size = SizeOfMost(pictures);
  if (first.video_frame >= 0) {
    try {
      size = ReadVideoFrameGrey(first.path, first.video_frame).size();
    } catch (const InputError&) {  // said where the frame is needed
    }
  }
  if (size.empty()) return;
  const std::optional<GPano> gpano = pictures.empty() ? std::nullopt : pictures.front().metadata.gpano;
  if (const auto sphere = EquirectangularCamera(*run, gpano, size)) {
    run->cameras.push_back({.name = "cam0", .camera = *sphere, .cam_from_body = LevelForwardCamera()});
    return;
  }
  if (IsTwiceAsWide(size)) {
    run->warnings.push_back(run->dir.string() + ": the pictures are twice as wide as high; if they are 360 pictures " +
                            "(equirectangular), write 'camera: equirectangular' into run.yaml");
  }
  const std::vector<SampledPicture> by_focal = WithFocalLength(pictures, size);
  const bool exif = !by_focal.empty();
  const SampledPicture* const middle = exif ? &by_focal[by_focal.size() / 2] : nullptr;
  const double focal = exif ? *middle->metadata.focal_px : kUsualFocal * std::max(size.width, size.height);
  run->cameras.push_back({.name = "cam0",
                          .camera = Camera(CameraModel::kPinhole, size.width, size.height,
                                           {focal, focal, 0.5 * (size.width - 1), 0.5 * (size.height - 1)}),
                          .cam_from_body = LevelForwardCamera(),
                          .focal_sigma_share = exif ? kExifFocalSigma : kUnknownFocalSigma,
                          .guessed_focal_px = focal});
  run->warnings.push_back(run->dir.string() + ": no camchain.yaml; the focal length " +
                          (exif ? "begins with the EXIF of " + middle->image->path.filename().string() + " and " : "") +
                          "is estimated with the distortion from the images: calibrate the camera for accuracy");
  if (exif) WarnOfOtherLenses(by_focal, run);
}

// A folder of masks in which no image finds its own is a wrong folder.
void WarnOfUnusedMasks(Run* run) {
  const auto is_crop = [&](size_t c) { return run->cameras[c].part.kind == PicturePart::Kind::kCrop; };
  for (size_t c = 0; c < run->cameras.size(); ++c) {
    for (const std::filesystem::path& folder : run->cameras[c].mask.folders) {
      const bool used = std::any_of(run->images.begin(), run->images.end(), [&](const ImageEntry& image) {
        const auto its = static_cast<size_t>(image.camera);
        const bool sees = its == c || (is_crop(its) && is_crop(c));  // a picture belongs to all crops
        return sees && !MaskInFolder(folder, image.file, image.path).empty();
      });
      if (used) continue;
      run->warnings.push_back((run->dir / "run.yaml").string() + ": key 'masks': " + folder.string() +
                              " has a mask for none of the images; expected IMAGE.png, or the image's name with .png");
    }
  }
}

}  // namespace

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
  config.equirectangular = config.camera == "equirectangular";
  if (config.equirectangular) config.camera.clear();
  config.mirrored = map.Bool("mirrored", config.mirrored);
  if (map.Has("masks") && !map.Node("masks").IsMap()) {
    config.masks[""] = ReadMask(map, "masks");  // one for all cameras
  } else {
    const YamlMap masks = map.MapOfAnyKeys("masks");
    for (const std::string& camera : masks.Keys()) config.masks[camera] = ReadMask(masks, camera);
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
  if (!(config.odometry_scale_sigma > 0)) {
    odometry.Fail("scale_sigma",
                  "expected more than 0, the 1 sigma of the odometry's scale as a part of 1, such as 0.01");
  }
  config.odometry_time_offset_s = odometry.Number("time_offset_s", 0);
  const YamlMap video = map.Map("video", {"start_s", "every"});
  config.video_start_s = video.Number("start_s", 0);
  config.video_every = video.Integer("every", config.video_every);
  if (config.video_every < 1) video.Fail("every", "expected 1 or more");
  return config;
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

GpsTrack ReadGpsFile(const std::filesystem::path& file, const RunConfig& config) {
  const RunClock clock{config.time_zero_utc_ns, config.date};
  if (file.extension() == ".nmea") return ReadNmea(file, clock);
  return file.extension() == ".gpx" ? ReadGpx(file, clock) : ReadGpsCsv(file);
}

Run ReadRunSettings(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir) {
  Run run;
  run.dir = std::filesystem::absolute(run_dir).lexically_normal();
  if (!run.dir.has_filename()) run.dir = run.dir.parent_path();
  if (!std::filesystem::is_directory(run.dir)) throw InputError(run.dir.string() + ": there is no such run folder");
  run.name = run.dir.filename().string();
  run.config = ReadRunConfig(run.dir / "run.yaml");
  run.cameras = ReadCameras(site_dir, run);
  ResolveMasks(site_dir, &run);
  AssignMasks(&run);
  WarnOfImplausibleCameras(&run);
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
  if (run->cameras.empty() && !run->images.empty()) {
    GuessCamera(run);
    AssignMasks(run);
  } else if (run->config.equirectangular && !run->cameras.empty() &&
             run->cameras.front().camera.model() != CameraModel::kEquirectangular) {
    throw InputError((run->dir / "run.yaml").string() +
                     ": key 'camera': equirectangular, and camchain.yaml has camera '" + run->cameras.front().name +
                     "' of another model; leave one of the two out");
  }
  if (run->cameras.empty()) {
    throw InputError(run->dir.string() + ": no camera; expected camchain.yaml, 'camera: NAME' in run.yaml, or " +
                     "pictures whose EXIF states the focal length");
  }
  WarnOfUnusedMasks(run);
  ReadOdometry(run);
  ReadGps(run);
  LeaveOutHeldFixes(run);
  CompareTimes(run);
  SplitPictures(run);
}

Run ReadRun(const std::filesystem::path& run_dir, const std::filesystem::path& site_dir) {
  Run run = ReadRunSettings(run_dir, site_dir);
  ReadRunData(site_dir, &run);
  return run;
}

}  // namespace trigpoint
