// Corners of a tag that a rolling shutter has seen while it moved past.
#include "eval/evidence/rolling_tags.h"

#include <gtest/gtest.h>

#include "calib/camera/rolling_shutter.h"

namespace trigpoint {
namespace {

constexpr double kReadout_s = 0.03, kSize_m = 0.2;

// Moves to the right at 2 m/s and turns to the right at 0.5 rad/s, camera axes.
Rigid3d PoseAt(double t) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * t, Eigen::Vector3d::UnitY())), Eigen::Vector3d(2 * t, 0, 0)};
}

Eigen::Vector2d SeenAt(const Camera& camera, double t, const Eigen::Vector3d& point) {
  return *camera.Project(PoseAt(t).Inverse() * point);
}

TEST(RollingTags, CornersAreThoseOfTheImagesTime) {
  trigpoint::Run run;
  BodyCamera& camera = run.cameras.emplace_back();
  camera.name = "cam0";
  camera.camera = Camera::FromFieldOfView(960, 600, 1.2);
  camera.readout_s = kReadout_s;
  for (int k = -10; k <= 10; ++k) run.odometry.poses.push_back({20'000'000LL * k, PoseAt(0.02 * k)});
  ImageDetections image{0, "0.jpg", "cam0", {TagDetection()}};
  std::array<Eigen::Vector2d, 4> exact;
  TagDetection& tag = image.detections.front();
  tag.id = 7;
  for (size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d corner(k % 3 == 0 ? 0.5 : 0.5 + kSize_m, k < 2 ? 0.9 : 0.9 - kSize_m, 3);
    exact[k] = tag.corners[k] = SeenAt(camera.camera, 0, corner);
    for (int i = 0; i < 10; ++i) {
      tag.corners[k] = SeenAt(camera.camera, kReadout_s * RowOffset(camera.camera, tag.corners[k].y()), corner);
    }
    EXPECT_GT((tag.corners[k] - exact[k]).norm(), 5);
  }
  TagSizes known, unknown;
  known.size_m = kSize_m;
  for (const auto& [sizes, most_px] : {std::pair(known, 0.7), {unknown, 8.0}}) {
    std::vector<ImageDetections> images = {image};
    MoveToImageTimes(run, sizes, &images);
    for (size_t k = 0; k < 4; ++k) EXPECT_LT((images[0].detections[0].corners[k] - exact[k]).norm(), most_px);
  }
  camera.readout_s = 0;
  std::vector<ImageDetections> images = {image};
  MoveToImageTimes(run, known, &images);
  EXPECT_EQ(images[0].detections[0].corners, tag.corners);
}

}  // namespace
}  // namespace trigpoint
