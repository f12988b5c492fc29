#include "app/pipeline/calibrate_hand_eye.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>

#include "app/pipeline/rolling_tags.h"
#include "app/pipeline/stages.h"
#include "calib/base/counted.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/io/camchain.h"
#include "datasets/io/json_matrix.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int64_t kMaxGapNs = 2'000'000'000;
constexpr double kHardlySeen = 5;  // times less sharply than the other directions: it is named

fs::path DetectionsOf(const Project& project, const Run& run) {
  if (!run.detections.empty()) return run.detections;
  const fs::path file = project.ResultDir("detect", run.name) / "detections.csv";
  if (!fs::exists(file)) {
    throw InputError("run " + run.name + ": its tags are not detected yet; run `trigpoint detect` with --run " +
                     run.name + " first");
  }
  return file;
}

std::vector<HandEyeSight> Sights(const Project& project, const Run& run, const BodyCamera& camera,
                                 ProgressSink& progress) {
  const TagSizes& sizes = project.site().tags;
  std::vector<std::string> warnings;
  int without_odometry = 0;
  std::vector<ImageDetections> images = ReadDetections(DetectionsOf(project, run), 0.5, &warnings);
  MoveToImageTimes(run, sizes, &images);
  std::vector<HandEyeSight> sights = HandEyeSights(run, camera, sizes, images, &without_odometry);
  for (const std::string& warning : warnings) progress.Log(LogLevel::kWarning, warning);
  if (without_odometry > 0) {
    progress.Log(LogLevel::kWarning, Counted(without_odometry, "picture") + " with tags: no odometry at that time");
  }
  return sights;
}

}  // namespace

std::vector<HandEyeSight> HandEyeSights(const Run& run, const BodyCamera& camera, const TagSizes& sizes,
                                        const std::vector<ImageDetections>& images, int* without_odometry) {
  std::vector<HandEyeSight> sights;
  for (const ImageDetections& image : images) {
    if (image.camera != camera.name) continue;
    const int64_t stamp = BodyStamp(image.stamp_ns, camera);
    const std::optional<Rigid3d> pose = run.odometry.At(stamp, kMaxGapNs);
    *without_odometry += !pose;
    if (!pose) continue;
    for (const TagDetection& tag : image.detections) {
      const double size = sizes.SizeOf(tag.id);
      if (size <= 0) {
        throw InputError("tags.yaml: the size of tag " + std::to_string(tag.id) +
                         " is missing (size_m); it gives the scale of the camera's position");
      }
      HandEyeSight sight;
      sight.stamp_ns = stamp;
      sight.tag_id = tag.id;
      sight.odom_from_body = *pose;
      for (int k = 0; k < 4; ++k) {
        sight.corners_m[static_cast<size_t>(k)] = TagCorner(size, k);
        sight.pixels[static_cast<size_t>(k)] = tag.corners[static_cast<size_t>(k)];
      }
      sights.push_back(sight);
    }
  }
  return sights;
}

std::vector<fs::path> HandEyeInputs(const Project& project, const std::string& name) {
  const Run& run = project.run(name);
  std::vector<fs::path> inputs = {DetectionsOf(project, run)};
  for (const char* file : {"camchain.yaml", "run.yaml", "odometry.tum", "odometry.txt", "odometry.csv"}) {
    if (fs::exists(run.dir / file)) inputs.push_back(run.dir / file);
  }
  if (fs::exists(project.dir() / "tags.yaml")) inputs.push_back(project.dir() / "tags.yaml");
  if (!run.config.camera.empty())
    inputs.push_back(project.results() / "calibrate" / run.config.camera / "camchain.yaml");
  return inputs;
}

void CalibrateHandEyeOfRun(const std::string& name, const HandEyeOptions& options, StageContext& context) {
  const Run& run = context.project.run(name);
  if (run.odometry.poses.empty()) {
    throw InputError("run " + name + ": no odometry; hand-eye calibration needs odometry.tum of the body");
  }
  std::vector<BodyCamera> cameras = run.cameras;
  json documents = json::array();
  std::string text = "# Poses of the cameras on the body\n\n";
  for (BodyCamera& camera : cameras) {
    const HandEyeResult result = CalibrateHandEye(Sights(context.project, run, camera, context.progress), camera.camera,
                                                  camera.cam_from_body, options, context.progress, context.cancel);
    const Rigid3d body_from_cam = result.cam_from_body.Inverse();
    const Matrix6d covariance = InverseCovariance(result.cam_from_body, result.covariance);
    const Vector6d sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
    const Eigen::Vector3d t = body_from_cam.translation;
    const Eigen::Quaterniond q = body_from_cam.rotation;
    const Vector6d change = body_from_cam.Minus(camera.cam_from_body.Inverse());
    camera.cam_from_body = result.cam_from_body;
    camera.has_extrinsics = true;
    // The direction in which the camera's place is least known.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(covariance.bottomRightCorner<3, 3>());
    const Eigen::Vector3d weak = spread.eigenvectors().col(2);
    const double weak_m = std::sqrt(std::max(0.0, spread.eigenvalues()[2]));
    const bool hardly = spread.eigenvalues()[2] > kHardlySeen * kHardlySeen * spread.eigenvalues()[1];
    std::string unseen;
    if (result.unseen_body.norm() > 0) {
      unseen = fmt::format(
          "The body turned about one axis only, so the camera's position along ({:.2f}, {:.2f}, {:.2f}) of the body "
          "axes is not observable. The value from before the calibration was kept, with a sigma of {:g} m. Measure "
          "it with a tape, or drive over a ramp.",
          result.unseen_body.x(), result.unseen_body.y(), result.unseen_body.z(), options.prior_m);
    } else if (hardly) {
      unseen = fmt::format(
          "The body hardly turned about more than one axis, so the camera's position along ({:.2f}, {:.2f}, {:.2f}) of "
          "the body axes is known to {:.3f} m only (1 sigma). Measure it with a tape, or drive over a ramp.",
          weak.x(), weak.y(), weak.z(), weak_m);
    }
    text += fmt::format(
        "{}: body_from_cam at ({:.4f}, {:.4f}, {:.4f}) m, sigma ({:.4f}, {:.4f}, {:.4f}) m; attitude known to ({:.3f}, "
        "{:.3f}, {:.3f}) deg (1 sigma, about the body's axes); {:.2f} deg and {:.3f} m from its pose before. "
        "Odometry scale {:.4f}, sigma {:.4f}. Corners fit to {:.2f} px (rms, odometry's errors included); {} of {} "
        "detections in {} passes.\n{}\n",
        camera.name, t.x(), t.y(), t.z(), sigma[3], sigma[4], sigma[5], sigma[0] / kDegToRad, sigma[1] / kDegToRad,
        sigma[2] / kDegToRad, change.head<3>().norm() / kDegToRad, change.tail<3>().norm(), result.scale,
        result.scale_sigma, result.rms_px, result.sights_used, result.sights, result.passes, unseen);
    documents.push_back(
        {{"name", camera.name},
         {"body_from_cam",
          {{"translation_m", {t.x(), t.y(), t.z()}}, {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}}},
         {"covariance", JsonRows(covariance)},
         {"sigma_rotation_deg", {sigma[0] / kDegToRad, sigma[1] / kDegToRad, sigma[2] / kDegToRad}},
         {"sigma_translation_m", {sigma[3], sigma[4], sigma[5]}},
         {"unseen_direction", {result.unseen_body.x(), result.unseen_body.y(), result.unseen_body.z()}},
         {"odometry_scale", result.scale},
         {"odometry_scale_sigma", result.scale_sigma},
         {"rms_px", result.rms_px},
         {"passes", result.passes},
         {"sights", result.sights},
         {"sights_used", result.sights_used}});
    if (!unseen.empty()) context.progress.Log(LogLevel::kWarning, camera.name + ": " + unseen);
    context.metrics["rms_px"] = result.rms_px;
  }
  WriteFileAtomically(context.out / "quality.md", text);
  WriteFileAtomically(context.out / "calibration.json",
                      DumpJson({{"schema", 1},
                                {"kind", "hand-eye"},
                                {"run", name},
                                {"covariance_of", "body_from_cam: rotation (rad), translation (m)"},
                                {"cameras", documents},
                                {"text", text}},
                               2) +
                          "\n");
  WriteCameraFiles(context.out, cameras, {"trigpoint calibrate --hand-eye " + name + "; sigmas: calibration.json"},
                   false);
  context.metrics["refused"] = false;
}

}  // namespace trigpoint
