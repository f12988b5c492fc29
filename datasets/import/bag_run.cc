#include "datasets/import/bag_run.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "calib/base/counted.h"
#include "calib/base/error.h"
#include "calib/base/median.h"
#include "datasets/calibration/camera_files.h"
#include "datasets/import/fast_png.h"
#include "datasets/import/frame_tree.h"
#include "datasets/import/run_folder.h"
#include "datasets/import/source_links.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/exif.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostPoses = 1'000'000;

struct CameraStream {
  BagTopic topic;
  std::string name, info_topic, frame, encoding;
  std::optional<RosCameraInfo> info;
  int width = 0, height = 0;
  int64_t seen = 0;
  std::set<int64_t> stamps;  // of the pictures that were written
};

// Messages that cannot be read: counted, the first is named.
struct Unreadable {
  int64_t count = 0;
  std::string first;
};

bool IsRectified(const std::string& topic) { return topic.find("image_rect") != std::string::npos; }

// Of the picture as the topic has it: a camera_info of the whole sensor is cut and shrunk by its roi and binning.
// Nothing where the bag's camera is not calibrated for this picture; `why` has the reason.
std::optional<Camera> CameraOf(const CameraStream& stream, std::string* why) {
  if (!stream.info || stream.info->k.front() == 0) {
    *why = stream.info ? "its camera_info states no calibration" : "the bag has no camera_info of it";
    return std::nullopt;
  }
  const RosCameraInfo& info = *stream.info;
  const std::vector<double>& p = info.p;
  const bool rectified = IsRectified(stream.topic.name);
  std::vector<double> k = rectified ? std::vector{p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]} : info.k;
  const auto width = static_cast<int>(info.width), height = static_cast<int>(info.height);
  const int shown_width = stream.width > 0 ? stream.width : width;  // no picture can be read: as stated
  const int shown_height = stream.height > 0 ? stream.height : height;
  if (width != shown_width || height != shown_height) {
    const double by_x = std::max(1U, info.binning_x), by_y = std::max(1U, info.binning_y);
    const double seen_x = info.roi_width > 0 ? info.roi_width : info.width;
    const double seen_y = info.roi_height > 0 ? info.roi_height : info.height;
    if (std::floor(seen_x / by_x) != shown_width || std::floor(seen_y / by_y) != shown_height) {
      *why = fmt::format("expected a camera_info of {} x {} px, the size of its pictures, found {} x {} px in topic {}",
                         shown_width, shown_height, width, height, stream.info_topic);
      return std::nullopt;
    }
    k[0] /= by_x;
    k[1] /= by_x;
    k[2] = (k[2] - info.roi_x + 0.5) / by_x - 0.5;
    k[4] /= by_y;
    k[5] = (k[5] - info.roi_y + 0.5) / by_y - 0.5;
  }
  const std::string where = "topic " + stream.info_topic;
  if (rectified) return OpenCvCamera(where, k, {}, "", shown_width, shown_height);
  return OpenCvCamera(where, k, info.d, info.distortion_model, shown_width, shown_height);
}

class BagImport {
 public:
  BagImport(const fs::path& site, fs::path bag, const BagRunOptions& options)
      : bag_(std::move(bag)), options_(options), run_(site, options.run) {}

  void Read(const BagContents& contents, ProgressSink& progress, const CancelToken& cancel) {
    choice_ = ChooseTopics(contents, options_.topics);
    if (!choice_.problem.empty()) throw InputError(bag_.string() + ": " + choice_.problem);
    for (const BagTopic& topic : choice_.images) {
      CameraStream& stream = streams_.emplace_back();
      stream.topic = topic;
      stream.name = fmt::format("cam{}", streams_.size() - 1);
      if (const BagTopic* info = CameraInfoOf(contents, topic.name)) stream.info_topic = info->name;
      fs::create_directories(run_.dir() / "images" / stream.name);
    }
    const auto is_wanted = [&](const BagTopic& topic) {
      const auto is = [&](const std::optional<BagTopic>& chosen) { return chosen && chosen->name == topic.name; };
      return RoleOf(topic) == BagRole::kTransforms || is(choice_.pose) || is(choice_.fix) || is(choice_.imu) ||
             std::any_of(streams_.begin(), streams_.end(), [&](const CameraStream& stream) {
               return stream.topic.name == topic.name || stream.info_topic == topic.name;
             });
    };
    const auto use = [&](const BagTopic& topic, const BagMessage& message) {
      try {
        Take(topic, message);
      } catch (const InputError& e) {
        Unreadable& unreadable = unreadable_[topic.name];
        if (unreadable.count++ == 0) unreadable.first = e.what();
      }
    };
    report_.warnings = ReadBag(bag_, is_wanted, use, progress, cancel);
  }

  ImportReport Finish() {
    for (const auto& [topic, unreadable] : unreadable_) {
      report_.warnings.push_back(
          fmt::format("topic {}: {} messages are left out; the first: {}", topic, unreadable.count, unreadable.first));
    }
    if (images_.empty()) {
      throw InputError(bag_.string() + ": no image could be read" +
                       (report_.warnings.empty() ? "" : "; " + report_.warnings.back()));
    }
    std::erase_if(streams_, [&](const CameraStream& stream) {
      if (stream.stamps.empty()) fs::remove(run_.dir() / "images" / stream.name);
      return stream.stamps.empty();
    });
    MeasurePictures();
    const bool calibrated = WriteCameras();
    if (!calibrated) {
      for (RunImage& image : images_) image.camera.clear();
    }
    WriteImageList(run_.dir(), images_, "from " + bag_.filename().string());
    files_.push_back("images.txt");
    WriteOdometry();
    WriteGps();
    CheckLevel();
    WriteSettings();
    const fs::path dir = run_.Complete();
    for (const std::string& file : files_) report_.files.push_back(dir / file);
    report_.files.push_back(dir / "images");
    return report_;
  }

 private:
  void Take(const BagTopic& topic, const BagMessage& message) {
    switch (RoleOf(topic)) {
      case BagRole::kImage: return TakeImage(topic, message);
      case BagRole::kCameraInfo:
        for (CameraStream& stream : streams_) {
          if (stream.info_topic == topic.name && !stream.info) stream.info = ReadRosCameraInfo(topic, message.bytes);
        }
        return;
      case BagRole::kPose: return TakePose(ReadRosPose(topic, message.bytes));
      case BagRole::kTransforms:
        for (const RosPose& transform : ReadRosTransforms(topic, message.bytes)) {
          tree_.Add(transform.header.frame, transform.child, transform.pose);
          // Odometry by its usual name (REP 105), where no topic has it.
          if (!choice_.pose && options_.topics.empty() && transform.header.frame.ends_with("odom")) TakePose(transform);
        }
        return;
      case BagRole::kFix: {
        const RosFix fix = ReadRosFix(topic, message.bytes);
        if (fix.valid && fixes_.size() < kMostPoses) fixes_.push_back(fix);
        return;
      }
      case BagRole::kImu: {
        const RosOrientation orientation = ReadRosOrientation(topic, message.bytes);
        // Ten a second are enough to judge by.
        if (!orientation.valid) return;
        if (!ups_.empty() && std::abs(orientation.header.stamp_ns - ups_.back().header.stamp_ns) < 100'000'000) return;
        if (ups_.size() < kMostPoses) ups_.push_back(orientation);
        return;
      }
      case BagRole::kNone: return;
    }
  }

  void TakePose(const RosPose& pose) {
    if (poses_.empty()) {
      body_ = pose.child;
      odom_ = pose.header.frame;
    }
    if (pose.child != body_ || pose.header.frame != odom_) return;
    if (poses_.size() >= kMostPoses)
      throw InputError("expected at most " + std::to_string(kMostPoses) + " poses; the rest is not used");
    poses_.push_back({pose.header.stamp_ns, pose.pose});
  }

  void TakeImage(const BagTopic& topic, const BagMessage& message) {
    CameraStream& stream = *std::find_if(streams_.begin(), streams_.end(),
                                         [&](const CameraStream& s) { return s.topic.name == topic.name; });
    if (stream.seen++ % options_.every != 0) return;
    const RosImage image = ReadRosImage(topic, message.bytes);
    const int64_t stamp = image.header.stamp_ns != 0 ? image.header.stamp_ns : message.logged_ns;
    if (!stream.stamps.insert(stamp).second) throw InputError("another image has the same time");
    if (stream.stamps.size() == 1) {
      stream.frame = image.header.frame;
      stream.encoding = image.encoding;
    }
    std::string file = fmt::format("images/{}/{:019d}", stream.name, stamp);
    if (topic.type == "sensor_msgs/CompressedImage") {
      const std::string_view bytes(reinterpret_cast<const char*>(image.data.data()), image.data.size());
      const bool jpeg = bytes.starts_with("\xFF\xD8"), png = bytes.starts_with("\x89PNG\r\n");
      if (!jpeg && !png) throw InputError("expected JPEG or PNG, found the format '" + image.encoding + "'");
      file += jpeg ? ".jpg" : ".png";
      WriteBytes(run_.dir() / file, bytes);
    } else {
      const cv::Mat picture = PictureOf(image, &converted_);
      stream.width = picture.cols;
      stream.height = picture.rows;
      file += ".png";
      if (picture.depth() == CV_8U) {
        WriteBytes(run_.dir() / file, png_.Write(picture));
      } else {
        cv::imencode(".png", picture, encoded_);
        WriteBytes(run_.dir() / file, {reinterpret_cast<const char*>(encoded_.data()), encoded_.size()});
      }
    }
    images_.push_back({stamp, file, stream.name});
  }

  // The folder is renamed as a whole, so that a file need not be.
  static void WriteBytes(const fs::path& file, std::string_view bytes) {
    std::ofstream out(file, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) throw IoError(file.string() + ": cannot be written; is the disk full?");
  }

  // Compressed pictures have their size in themselves.
  void MeasurePictures() {
    for (const RunImage& image : images_) {
      CameraStream& stream =
          *std::find_if(streams_.begin(), streams_.end(), [&](const auto& s) { return s.name == image.camera; });
      if (stream.width != 0) continue;
      try {
        const PhotoMetadata picture = ReadPhotoMetadata(run_.dir() / image.file);
        stream.width = picture.width;
        stream.height = picture.height;
      } catch (const InputError&) {  // the next one may be readable; this one is judged where it is used
      }
    }
  }

  // Of the streams that have pictures; empty if one of them is not calibrated.
  std::vector<BodyCamera> Calibrations() {
    std::vector<BodyCamera> cameras;
    if (!options_.cameras.empty()) {
      cameras = ReadCamerasFor(options_.cameras, streams_.size(), bag_.filename().string(), streams_.front().width,
                               streams_.front().height);
      for (size_t i = 0; i < cameras.size(); ++i) cameras[i].name = streams_[i].name;
      return cameras;
    }
    for (const CameraStream& stream : streams_) {
      std::string why;
      const std::optional<Camera> camera = CameraOf(stream, &why);
      if (!camera) {
        report_.warnings.push_back(
            fmt::format("topic {}: {}; calibrate the camera (trigpoint calibrate), or name a "
                        "calibration by --cameras",
                        stream.topic.name, why));
        return {};
      }
      cameras.push_back({.name = stream.name, .camera = *camera, .cam_from_body = LevelForwardCamera()});
    }
    return cameras;
  }

  // False: no calibration is known, and camchain.yaml is not written.
  bool WriteCameras() {
    std::vector<BodyCamera> cameras = Calibrations();
    if (cameras.empty() && streams_.size() > 1) {
      throw InputError(report_.warnings.back() + "; or take one camera by --topic");
    }
    for (size_t i = 0; i < streams_.size(); ++i) {
      const CameraStream& stream = streams_[i];
      report_.lines.push_back(fmt::format("{}: {}, {} images of {} ({})", stream.name, stream.topic.name,
                                          stream.stamps.size(), stream.seen, stream.encoding));
      if (!cameras.empty() && options_.cameras.empty()) Mount(stream, &cameras[i]);
    }
    if (cameras.empty()) return false;
    std::vector<std::string> comments = {"cameras of " + bag_.filename().string()};
    for (const CameraStream& stream : streams_) comments.push_back(stream.name + ": " + stream.topic.name);
    WriteCamchain(run_.dir() / "camchain.yaml", cameras, comments);
    files_.push_back("camchain.yaml");
    return true;
  }

  // Where the camera sits on the body of the odometry, from the transforms that stay the same.
  void Mount(const CameraStream& stream, BodyCamera* camera) {
    const std::string body = !body_.empty() ? body_ : tree_.Has("base_link") ? "base_link" : "";
    const auto mounted = body.empty() ? std::nullopt : tree_.Find(stream.frame, body);
    if (mounted) {
      camera->cam_from_body = *mounted;
      camera->has_extrinsics = true;
      const Eigen::Vector3d axis = mounted->rotation.conjugate() * Eigen::Vector3d::UnitZ();
      report_.lines.push_back(fmt::format("{} looks along ({:.3f}, {:.3f}, {:.3f}) of {}, by the transforms of {}",
                                          stream.name, axis.x(), axis.y(), axis.z(), body, stream.frame));
      if (std::abs(axis.z()) > 0.9 && stream.frame.find("optical") == std::string::npos) {
        report_.warnings.push_back(
            fmt::format("frame {}: its z axis is vertical; expected the optical frame (z along the "
                        "view): correct T_cam_imu in camchain.yaml if the camera looks elsewhere",
                        stream.frame));
      }
      return;
    }
    const std::string missing =
        fmt::format("the bag has no fixed transform between {} and {}", body.empty() ? "a body" : body,
                    stream.frame.empty() ? "a frame of " + stream.topic.name : stream.frame);
    if (streams_.size() > 1) {
      throw InputError(bag_.string() + ": " + missing +
                       ": the mutual pose of the cameras is not known; name a "
                       "camchain.yaml by --cameras, or take one camera by --topic");
    }
    report_.warnings.push_back(missing +
                               "; the camera is taken to look straight ahead (trigpoint calibrate --hand-eye "
                               "finds its rotation)");
  }

  void WriteOdometry() {
    if (poses_.empty()) {
      report_.warnings.push_back("no odometry: neither a topic nor transforms of a frame 'odom'");
      return;
    }
    std::stable_sort(poses_.begin(), poses_.end(),
                     [](const TimedPose& a, const TimedPose& b) { return a.stamp_ns < b.stamp_ns; });
    const auto same = [](const TimedPose& a, const TimedPose& b) { return a.stamp_ns == b.stamp_ns; };
    poses_.erase(std::unique(poses_.begin(), poses_.end(), same), poses_.end());
    const std::string source = choice_.pose ? choice_.pose->name : "the transforms";
    WriteTum(run_.dir() / "odometry.tum", poses_,
             {fmt::format("{}: {} in {}", source, body_.empty() ? "a body" : body_, odom_)});
    files_.push_back("odometry.tum");
    report_.lines.push_back(fmt::format("odometry: {} of {} in {}, from {}", Counted(poses_.size(), "pose"),
                                        body_.empty() ? "an unnamed body" : body_, odom_, source));
    if (body_.empty()) {
      report_.warnings.push_back("the poses of " + source +
                                 " do not state whose they are; they are taken as those of base_link");
    }
  }

  void WriteGps() {
    if (fixes_.empty()) {
      if (choice_.fix) report_.warnings.push_back("topic " + choice_.fix->name + ": no valid position");
      return;
    }
    CsvWriter csv({"timestamp_s", "latitude_deg", "longitude_deg", "height_m", "sigma_h_m", "sigma_v_m"},
                  {choice_.fix->name + " of " + bag_.filename().string()});
    const auto known = [](double value) { return value > 0 ? value : std::nan(""); };
    for (const RosFix& fix : fixes_) {
      csv.Stamp(fix.header.stamp_ns).Number(fix.position.latitude_deg, 9).Number(fix.position.longitude_deg, 9);
      csv.Number(fix.position.height_m, 4).Number(known(fix.sigma_h_m), 4).Number(known(fix.sigma_v_m), 4);
      csv.EndRow();
    }
    csv.Save(run_.dir() / "gps.csv");
    files_.push_back("gps.csv");
    report_.lines.push_back(fmt::format("GPS: {} positions from {}", fixes_.size(), choice_.fix->name));
  }

  // How far the odometry's z axis is from the IMU's vertical.
  void CheckLevel() {
    if (poses_.empty() || ups_.empty()) return;
    const std::optional<Rigid3d> body_from_imu = tree_.Find(body_, ups_.front().header.frame);
    if (!body_from_imu) return;
    const Trajectory trajectory{poses_, {}};
    std::vector<double> tilts;
    for (const RosOrientation& up : ups_) {
      const auto odom_from_body = trajectory.At(up.header.stamp_ns, 1'000'000'000);
      if (!odom_from_body) continue;
      const Eigen::Vector3d up_in_imu = up.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d up_in_odom = odom_from_body->rotation * (body_from_imu->rotation * up_in_imu);
      tilts.push_back(std::acos(std::clamp(up_in_odom.z(), -1.0, 1.0)) / kDegToRad);
    }
    if (tilts.empty()) return;
    report_.lines.push_back(
        fmt::format("level: the odometry's z axis is {:.2f} deg (median of {}) from the vertical of {}; odometry is "
                    "taken as not levelled: if the angle is small, set odometry: {{levelled: true}} in run.yaml",
                    Median(tilts), tilts.size(), choice_.imu->name));
  }

  void WriteSettings() {
    std::string text = "# From " + bag_.filename().string() + ".\n";
    const int64_t first = images_.front().stamp_ns / 1'000'000'000;
    constexpr int64_t kYear2000 = 946'684'800;
    if (first > kYear2000) text += fmt::format("date: {:%Y-%m-%d}\n", fmt::gmtime(static_cast<std::time_t>(first)));
    if (!fixes_.empty() && !body_.empty()) {
      if (const auto antenna = tree_.Find(body_, fixes_.front().header.frame)) {
        const Eigen::Vector3d& t = antenna->translation;
        text += fmt::format("gps:\n  lever_arm_m: [{:.4f}, {:.4f}, {:.4f}]  # of {} in {}\n", t.x(), t.y(), t.z(),
                            fixes_.front().header.frame, body_);
      }
    }
    WriteFileAtomically(run_.dir() / "run.yaml", text);
    files_.push_back("run.yaml");
  }

  fs::path bag_;
  const BagRunOptions& options_;
  RunFolder run_;
  BagChoice choice_;
  std::vector<CameraStream> streams_;
  std::vector<RunImage> images_;
  std::vector<TimedPose> poses_;  // odom_from_body
  std::string body_, odom_;       // frames of the poses
  std::vector<RosFix> fixes_;
  std::vector<RosOrientation> ups_;
  FrameTree tree_;
  std::map<std::string, Unreadable> unreadable_;
  std::vector<uchar> encoded_;
  cv::Mat converted_;
  FastPngWriter png_;
  std::vector<std::string> files_;
  ImportReport report_;
};

}  // namespace

ImportReport ImportBagRun(const fs::path& site, const fs::path& bag, const BagRunOptions& options,
                          ProgressSink& progress, const CancelToken& cancel) {
  if (options.every < 1) throw OptionError("--every: expected 1 or more, found " + std::to_string(options.every));
  RequireFilesInside(bag);
  BagImport import(site, bag, options);
  const BagContents contents = ListBag(bag, cancel);
  import.Read(contents, progress, cancel);
  return import.Finish();
}

}  // namespace trigpoint
