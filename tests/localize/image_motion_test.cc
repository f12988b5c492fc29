// The motion of a run without odometry: how long it is, which way is up.
#include "localize/reconstruct/image_motion.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "datasets/io/gps.h"
#include "tests/support/project_folder.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

constexpr double kTrueLength = 10;  // m a unit

struct Walk {
  std::vector<TimedPose> motion;
  std::vector<GpsFix> gps;
};

// Round a corner, 100 m each way, a fix every 10 m.
Walk MakeWalk(double sigma_m) {
  const LocalFrame frame({48, 7.8, 250});
  Walk walk;
  for (int k = 0; k <= 20; ++k) {
    const Eigen::Vector3d place(std::min(k, 10), std::max(0, k - 10), 0);
    walk.motion.push_back({k * 1'000'000'000LL, Rigid3d(Eigen::Quaterniond::Identity(), place)});
    walk.gps.push_back({k * 1'000'000'000LL, frame.GeodeticFromEnu(kTrueLength * place), sigma_m, 10});
  }
  return walk;
}

TEST(LengthByGps, IsThatOfMostFixes) {
  Walk walk = MakeWalk(5);
  ASSERT_TRUE(LengthByGps(walk.gps, walk.motion));
  EXPECT_NEAR(*LengthByGps(walk.gps, walk.motion), kTrueLength, 1e-3);
  // A phone's first fix is an old one, from kilometres away or with an error of that size.
  walk.gps.front().position.latitude_deg += 0.05;
  walk.gps.front().sigma_h_m = 5000;
  ASSERT_TRUE(LengthByGps(walk.gps, walk.motion));
  EXPECT_NEAR(*LengthByGps(walk.gps, walk.motion), kTrueLength, 0.1 * kTrueLength);
  EXPECT_FALSE(LengthByGps(MakeWalk(50).gps, walk.motion)) << "as long as its noise";
  walk.gps.resize(2);
  EXPECT_FALSE(LengthByGps(walk.gps, walk.motion));
  // A strip of pictures straight down: their frame may stand on its side.
  walk = MakeWalk(5);
  for (TimedPose& pose : walk.motion) {
    const Eigen::Vector3d level = pose.target_from_body.translation;
    pose.target_from_body.translation = {0, level.x(), level.y()};
  }
  ASSERT_TRUE(LengthByGps(walk.gps, walk.motion));
  EXPECT_NEAR(*LengthByGps(walk.gps, walk.motion), kTrueLength, 1e-3);
}

// Strips of pictures straight down, all with one heading: by their tops, the motion stands on its side.
TEST(UpByGps, IsThatOfMostFixes) {
  const Walk corner = MakeWalk(5);
  EXPECT_GT(UpByGps(corner.gps, corner.motion)->z(), 0.999);
  Walk strips = corner;
  for (TimedPose& pose : strips.motion) {
    const Eigen::Vector3d level = pose.target_from_body.translation;
    pose.target_from_body.translation = {-level.z(), level.y(), level.x()};
  }
  // The sea may lie 50 m from the ellipsoid, but everywhere by the same. One fix is kilometres off.
  for (GpsFix& fix : strips.gps) CountFromSea(&fix);
  strips.gps[3].position.latitude_deg += 0.05;
  ASSERT_TRUE(UpByGps(strips.gps, strips.motion));
  EXPECT_NEAR(UpByGps(strips.gps, strips.motion)->x(), -1, 1e-3);
  // A line shows no tilt about itself, nor do fixes without heights or as far apart as their noise.
  Walk line = corner;
  line.gps.resize(10);
  EXPECT_FALSE(UpByGps(line.gps, line.motion));
  for (GpsFix& fix : strips.gps) fix.sigma_v_m = kUnknownHeightSigma;
  EXPECT_FALSE(UpByGps(strips.gps, strips.motion));
  Walk noisy = corner;
  for (GpsFix& fix : noisy.gps) fix.sigma_v_m = 100;
  EXPECT_FALSE(UpByGps(noisy.gps, noisy.motion));
}

TEST(FollowReconstruction, TakesOverHowWellTheLengthOfAMotionIsKnown) {
  const TempDir dir;
  LocalizeInput input;
  input.pose_stamps = {0, 1'000'000'000LL};
  const Rigid3d ahead(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 0, 0));
  BundleProblem solved;
  solved.poses = {Rigid3d(), ahead.Inverse()};
  WriteMotion(input, solved, "m, by the cameras' places on the body", 0.0123, dir.path() / kMotionFile);
  trigpoint::Run run;
  FollowReconstruction(dir.path(), &run);
  ASSERT_EQ(run.odometry.poses.size(), 2);
  EXPECT_NEAR(run.odometry.poses.back().target_from_body.translation.x(), 1, 1e-9);
  EXPECT_NEAR(run.config.odometry_scale_sigma, 0.0123, 1e-9);
  WriteMotion(input, solved, "unknown", kUnknownScaleSigma, dir.path() / kMotionFile);
  trigpoint::Run without_unit;
  FollowReconstruction(dir.path(), &without_unit);
  EXPECT_EQ(without_unit.config.odometry_scale_sigma, kUnknownScaleSigma);
}

TEST(FollowReconstruction, MovesOdometryAsItsImagesAreLate) {
  const TempDir dir;
  trigpoint::Run run;
  run.odometry.poses = {{5'000'000'000LL, Rigid3d()}, {6'000'000'000LL, Rigid3d()}};
  run.config.odometry_time_offset_s = 0.5;
  FollowReconstruction(dir.path(), &run);
  EXPECT_EQ(run.odometry.poses.back().stamp_ns, 6'000'000'000LL);
  WriteOdometryTime(-0.123456789, 0.01, dir.path() / kOdometryTimeFile);
  FollowReconstruction(dir.path(), &run);
  EXPECT_EQ(run.odometry.poses.front().stamp_ns, 5'000'000'000LL - 123'456'789);
  EXPECT_EQ(run.odometry.poses.back().stamp_ns, 6'000'000'000LL - 123'456'789);
  EXPECT_NEAR(run.config.odometry_time_offset_s, 0.5 - 0.123456789, 1e-12);
}

}  // namespace
}  // namespace trigpoint
