// A camera whose clock is ahead of the body's: the body's motion is asked for at the moments that its images show.
#include <gtest/gtest.h>

#include <cmath>

#include "app/pipeline/calibrate_hand_eye.h"
#include "eval/evidence/tag_views.h"
#include "localize/files/job.h"
#include "localize/files/tables.h"
#include "survey/tags/hand_eye_sights.h"

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
  LocalizeInput input;
  input.cameras = ShiftedRun().cameras;
  Localization result;
  for (int k = 0; k < 3; ++k) {
    const int64_t stamp = 1'000'000'000LL * k, moment = stamp + std::llround(1e9 * kShift_s);
    input.images.push_back({stamp, std::to_string(k) + ".jpg", 0, k});
    input.pose_stamps.push_back(moment);
    result.body_from_odom.push_back(BodyAt(1e-9 * static_cast<double>(moment)).Inverse());
  }
  const Trajectory trajectory = FirstCameraTrajectory(input, result);
  ASSERT_EQ(trajectory.poses.size(), 3U);
  for (const TimedPose& pose : trajectory.poses) {
    const Rigid3d truth = BodyAt(1e-9 * static_cast<double>(pose.stamp_ns));
    EXPECT_LT((pose.target_from_body.translation - truth.translation).norm(), 1e-9);
  }
  EXPECT_EQ(trajectory.poses.front().stamp_ns, std::llround(1e9 * kShift_s));
}

TEST(CameraClock, ImagesWithTagsHaveTheBodyAtTheirOwnTime) {
  trigpoint::Run run = ShiftedRun();
  run.cameras.push_back(run.cameras.front());
  run.cameras[0].cam_from_body.translation.y() = 0.3;
  run.cameras[1].name = "cam1";
  run.cameras[1].time_offset_s = 0.1;
  const ImageDetections first{2'000'000'000, "2.jpg", "cam0", {TagDetection()}};
  ImageDetections second = first, together = first;
  second.camera = together.camera = "cam1";
  together.stamp_ns = 2'300'000'000;  // the second camera, while the first one takes `first`
  Solution solution;
  for (const double moment : {2.1, 2.4}) {
    solution.pose_stamps.push_back(std::llround(1e9 * moment));
    solution.problem.poses.push_back(BodyAt(moment).Inverse());
  }
  OwnViews own = TagViews(run, {}, &solution, {first, second, together});
  ASSERT_EQ(own.views.size(), 3U);
  const double moments[] = {2.4, 2.1, 2.4};
  for (size_t k = 0; k < 3; ++k) {
    const BodyCamera& camera = run.cameras[k == 0 ? 0 : 1];
    const Rigid3d truth = BodyAt(moments[k]) * camera.cam_from_body.Inverse();
    EXPECT_EQ(own.views[k].camera, &camera.camera);
    EXPECT_LT((own.views[k].world_from_cam.translation - truth.translation).norm(), 1e-9) << k;
    EXPECT_LT(AngleBetween(own.views[k].world_from_cam.rotation, truth.rotation), 1e-6) << k;
  }
  // Of older programs: the poses of the first camera alone.
  LocalizeResult result;
  result.cameras_odom.push_back({first.stamp_ns, own.views[0].world_from_cam});
  const Rigid3d expected = own.views[2].world_from_cam;
  own = TagViews(run, result, nullptr, {first, second, together});
  ASSERT_EQ(own.views.size(), 2U);
  EXPECT_EQ(own.images[1], std::make_pair(together.stamp_ns, std::string("cam1")));
  EXPECT_LT((own.views[1].world_from_cam.translation - expected.translation).norm(), 1e-9);
}

}  // namespace
}  // namespace trigpoint
