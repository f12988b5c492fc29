// A camera whose clock is ahead of the body's: the body's motion is asked for at the moments that its images show.
#include <gtest/gtest.h>

#include <cmath>

#include "app/pipeline/calibrate_hand_eye.h"
#include "app/pipeline/localize_files.h"

namespace trigpoint {
namespace {

constexpr double kShift_s = 0.4;  // timeshift_cam_imu

// Drives at 2 m/s and turns at half a radian a second.
Rigid3d BodyAt(double second) { return {ExpSO3({0, 0, 0.5 * second}), Eigen::Vector3d(2 * second, 0, 0)}; }

trigpoint::Run ShiftedRun() {
  trigpoint::Run run;
  BodyCamera& camera = run.cameras.emplace_back();
  camera.name = "cam0";
  camera.camera = Camera::FromFieldOfView(960, 600, 1.2);
  camera.time_offset_s = kShift_s;
  for (int k = 0; k <= 100; ++k) run.odometry.poses.push_back({100'000'000LL * k, BodyAt(0.1 * k)});
  return run;
}

TEST(CameraClock, HandEyeTakesTheBodyWhereTheImageWasTaken) {
  const trigpoint::Run run = ShiftedRun();
  ImageDetections image{2'000'000'000, "2.jpg", "cam0", {TagDetection()}};
  image.detections.front().id = 7;
  ImageDetections late{10'000'000'000, "10.jpg", "cam0", image.detections};  // shows what odometry no longer has
  ImageDetections other{2'000'000'000, "2.jpg", "cam1", image.detections};
  TagSizes sizes;
  sizes.size_m = 0.2;
  int without = 0;
  const std::vector<HandEyeSight> sights = HandEyeSights(run, run.cameras[0], sizes, {image, late, other}, &without);
  ASSERT_EQ(sights.size(), 1U);
  EXPECT_EQ(without, 1);
  EXPECT_EQ(sights[0].tag_id, 7);
  const Rigid3d truth = BodyAt(2 + kShift_s);
  EXPECT_LT((sights[0].odom_from_body.translation - truth.translation).norm(), 1e-9);
  EXPECT_LT(AngleBetween(sights[0].odom_from_body.rotation, truth.rotation), 1e-6);
}

// What the clocks of odometry and GPS are held against.
TEST(CameraClock, PosesOfTheFirstCameraAreOnTheBodysClock) {
  LocalizeJob job;
  job.input.cameras = ShiftedRun().cameras;
  Localization result;
  for (int k = 0; k < 3; ++k) {
    const int64_t stamp = 1'000'000'000LL * k, moment = stamp + std::llround(1e9 * kShift_s);
    job.input.images.push_back({stamp, std::to_string(k) + ".jpg", 0, k});
    job.input.pose_stamps.push_back(moment);
    result.body_from_odom.push_back(BodyAt(1e-9 * static_cast<double>(moment)).Inverse());
  }
  const Trajectory trajectory = FirstCameraTrajectory(job, result);
  ASSERT_EQ(trajectory.poses.size(), 3U);
  for (const TimedPose& pose : trajectory.poses) {
    const Rigid3d truth = BodyAt(1e-9 * static_cast<double>(pose.stamp_ns));
    EXPECT_LT((pose.target_from_body.translation - truth.translation).norm(), 1e-9);
  }
  EXPECT_EQ(trajectory.poses.front().stamp_ns, std::llround(1e9 * kShift_s));
}

}  // namespace
}  // namespace trigpoint
