#include "datasets/calibration/hand_eye_files.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "calib/geo/geodetic.h"
#include "datasets/calibration/calibrate_files.h"
#include "datasets/io/json_matrix.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kHardlySeen = 5;  // times less sharply than the other directions: it is named

// The same of body_from_cam.
struct PoseOnBody {
  Rigid3d body_from_cam;
  Matrix6d covariance;
  Vector6d sigma;
};

PoseOnBody PoseOf(const HandEyeResult& found) {
  const Matrix6d covariance = InverseCovariance(found.cam_from_body, found.covariance);
  return {found.cam_from_body.Inverse(), covariance, covariance.diagonal().cwiseMax(0).cwiseSqrt()};
}

std::string TextOf(const CameraOnBody& c) {
  const HandEyeResult& found = c.found;
  const PoseOnBody pose = PoseOf(found);
  const Vector6d& sigma = pose.sigma;
  const Eigen::Vector3d& t = pose.body_from_cam.translation;
  const Vector6d change = pose.body_from_cam.Minus(c.camera.cam_from_body.Inverse());
  return fmt::format(
      "{}: body_from_cam at ({:.4f}, {:.4f}, {:.4f}) m, sigma ({:.4f}, {:.4f}, {:.4f}) m; attitude known to ({:.3f}, "
      "{:.3f}, {:.3f}) deg (1 sigma, about the body's axes); {:.2f} deg and {:.3f} m from its pose before. "
      "Odometry scale {:.4f}, sigma {:.4f}. Corners fit to {:.2f} px (rms, odometry's errors included); {} of {} "
      "detections in {} passes.\n{}\n",
      c.camera.name, t.x(), t.y(), t.z(), sigma[3], sigma[4], sigma[5], sigma[0] / kDegToRad, sigma[1] / kDegToRad,
      sigma[2] / kDegToRad, change.head<3>().norm() / kDegToRad, change.tail<3>().norm(), found.scale,
      found.scale_sigma, found.rms_px, found.sights_used, found.sights, found.passes, c.unseen);
}

json JsonOf(const CameraOnBody& c) {
  const HandEyeResult& found = c.found;
  const PoseOnBody pose = PoseOf(found);
  const Vector6d& sigma = pose.sigma;
  const Eigen::Vector3d& t = pose.body_from_cam.translation;
  const Eigen::Quaterniond& q = pose.body_from_cam.rotation;
  return {
      {"name", c.camera.name},
      {"body_from_cam", {{"translation_m", {t.x(), t.y(), t.z()}}, {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}}},
      {"covariance", JsonRows(pose.covariance)},
      {"sigma_rotation_deg", {sigma[0] / kDegToRad, sigma[1] / kDegToRad, sigma[2] / kDegToRad}},
      {"sigma_translation_m", {sigma[3], sigma[4], sigma[5]}},
      {"unseen_direction", {found.unseen_body.x(), found.unseen_body.y(), found.unseen_body.z()}},
      {"odometry_scale", found.scale},
      {"odometry_scale_sigma", found.scale_sigma},
      {"rms_px", found.rms_px},
      {"passes", found.passes},
      {"sights", found.sights},
      {"sights_used", found.sights_used}};
}

}  // namespace

std::string UnseenOf(const HandEyeResult& found, double prior_m) {
  // The direction in which the camera's place is least known.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(
      InverseCovariance(found.cam_from_body, found.covariance).bottomRightCorner<3, 3>());
  const Eigen::Vector3d weak = spread.eigenvectors().col(2);
  const double weak_m = std::sqrt(std::max(0.0, spread.eigenvalues()[2]));
  const bool hardly = spread.eigenvalues()[2] > kHardlySeen * kHardlySeen * spread.eigenvalues()[1];
  if (found.unseen_body.norm() > 0) {
    return fmt::format(
        "The body turned about one axis only, so the camera's position along ({:.2f}, {:.2f}, {:.2f}) of the body "
        "axes is not observable. The value from before the calibration was kept, with a sigma of {:g} m. Measure "
        "it with a tape, or drive over a ramp.",
        found.unseen_body.x(), found.unseen_body.y(), found.unseen_body.z(), prior_m);
  }
  if (hardly) {
    return fmt::format(
        "The body hardly turned about more than one axis, so the camera's position along ({:.2f}, {:.2f}, {:.2f}) of "
        "the body axes is known to {:.3f} m only (1 sigma). Measure it with a tape, or drive over a ramp.",
        weak.x(), weak.y(), weak.z(), weak_m);
  }
  return "";
}

void WriteHandEye(const fs::path& out, const std::string& run, const std::vector<CameraOnBody>& cameras) {
  json documents = json::array();
  std::string text = "# Poses of the cameras on the body\n\n";
  std::vector<BodyCamera> found;
  for (const CameraOnBody& c : cameras) {
    text += TextOf(c);
    documents.push_back(JsonOf(c));
    BodyCamera& camera = found.emplace_back(c.camera);
    camera.cam_from_body = c.found.cam_from_body;
    camera.has_extrinsics = true;
  }
  WriteFileAtomically(out / "quality.md", text);
  WriteFileAtomically(out / "calibration.json",
                      DumpJson({{"schema", 1},
                                {"kind", "hand-eye"},
                                {"run", run},
                                {"covariance_of", "body_from_cam: rotation (rad), translation (m)"},
                                {"cameras", documents},
                                {"text", text}},
                               2) +
                          "\n");
  WriteCameraFiles(out, found, {"trigpoint calibrate --hand-eye " + run + "; sigmas: calibration.json"}, false);
}

}  // namespace trigpoint
