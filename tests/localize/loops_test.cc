// A drive that comes back to where it began: the loop is found, closed, and believed only with reason.
#include "localize/loops.h"

#include <gtest/gtest.h>

#include "calib/geo/geodetic.h"
#include "localize/reconstruct_run.h"
#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

struct Drive {
  LocalizeInput input;
  std::vector<Rigid3d> odom_from_body;  // truth
  std::vector<test::SeenFeatures> seen;
};

// One lap and a bit in the middle of a yard whose walls are full of spots. Odometry: white noise, a heading that
// drifts, a scale of 1. `laps` < 1: it does not come back.
Drive MakeDrive(double laps, uint64_t seed) {
  Drive drive;
  Random random(seed);
  const double radius = 8, step = 0.5;
  const Camera camera = Camera::FromFieldOfView(960, 600, 1.7);
  BodyCamera body_camera;
  body_camera.name = "cam0";
  body_camera.camera = camera;
  // Camera axes (right, down, forward) in the body's (forward, left, up), looking 45 deg to the right.
  Eigen::Matrix3d cam_from_body;
  cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  body_camera.cam_from_body = {
      Eigen::Quaterniond(cam_from_body * Eigen::AngleAxisd(45 * kDegToRad, Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d::Zero()};
  body_camera.has_extrinsics = true;
  drive.input.cameras = {body_camera};
  std::vector<Eigen::Vector3d> points;
  std::vector<uint64_t> spots;
  for (uint64_t j = 0; j < 2500; ++j) {
    const double a = random.Uniform(0, 2 * EIGEN_PI), r = random.Uniform(13, 16);
    points.emplace_back(r * std::cos(a), r * std::sin(a), random.Uniform(-2, 5));
    spots.push_back(j);
  }
  const int n = static_cast<int>(laps * 2 * EIGEN_PI * radius / step);
  Rigid3d odometry;
  for (int k = 0; k < n; ++k) {
    const double a = k * step / radius;
    const Rigid3d world_from_body(Eigen::Quaterniond(Eigen::AngleAxisd(a + 0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ())),
                                  Eigen::Vector3d(radius * std::cos(a), radius * std::sin(a), 0));
    drive.odom_from_body.push_back(world_from_body);
    if (k > 0) {
      Rigid3d motion = drive.odom_from_body[static_cast<size_t>(k) - 1].Inverse() * world_from_body;
      motion.translation += 0.01 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
      motion.rotation = motion.rotation *
                        ExpSO3({0.001 * random.Normal(), 0.001 * random.Normal(), 0.001 * random.Normal() + 0.0004});
      odometry = odometry * motion;
    }
    drive.input.odom_from_body.push_back(odometry);
    drive.input.pose_stamps.push_back(k * 500000000LL);
    drive.input.images.push_back({k * 500000000LL, std::to_string(k), 0, k});
    drive.seen.push_back(test::See(camera, body_camera.cam_from_body * world_from_body.Inverse(), points, spots, 14,
                                   0.7, static_cast<uint64_t>(k) + 100 * seed));
  }
  return drive;
}

RunReconstruction Solve(Drive& drive, bool close) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  ReconstructRunOptions options;
  options.loops.close = close;
  options.loops.gap_m = 20;
  ProgressSink progress;
  return ReconstructRun(drive.input, options, false, 2, 1, progress, {});
}

// RMSE of body positions relative to the first pose, m.
double Error(const Drive& drive, const RunReconstruction& result) {
  const std::vector<Rigid3d>& body_from_odom = result.reconstruction.problem.poses;
  double sum = 0;
  for (size_t k = 0; k < body_from_odom.size(); ++k) {
    const Rigid3d truth = drive.odom_from_body[0].Inverse() * drive.odom_from_body[k];
    sum += (body_from_odom[k].TargetOriginInSource() - truth.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(body_from_odom.size()));
}

TEST(Loops, AreClosedAndHelp) {
  Drive drive = MakeDrive(1.15, 3);
  const RunReconstruction open = Solve(drive, false), closed = Solve(drive, true);
  EXPECT_EQ(open.loops.tried, 0);
  EXPECT_GE(closed.loops.tried, 3);
  EXPECT_GE(closed.loops.closed, 3);
  EXPECT_EQ(closed.loops.contradicting, 0);
  EXPECT_GT(closed.loops.merged_points, 100);
  // Where the drive meets its beginning, the passages fit.
  const size_t last = drive.seen.size() - 1;
  const auto miss = [&](const RunReconstruction& result) {
    const Rigid3d truth = drive.odom_from_body[0].Inverse() * drive.odom_from_body[last];
    return (result.reconstruction.problem.poses[last].TargetOriginInSource() - truth.translation).norm();
  };
  EXPECT_LT(miss(closed), 0.05);
  EXPECT_LT(miss(closed), 0.5 * miss(open));
  EXPECT_LT(Error(drive, closed), Error(drive, open));
}

TEST(Loops, AreNotLookedForWhereThereAreNone) {
  Drive drive = MakeDrive(0.8, 3);
  EXPECT_EQ(Solve(drive, true).loops.tried, 0);
}

// The end of the drive sees what its beginning saw, but 5 m farther on: a facade that stands twice. The images say one
// thing, the odometry another.
TEST(Loops, ACopyIsNotBelieved) {
  Drive drive = MakeDrive(1.06, 5);
  const size_t n = drive.seen.size();
  for (size_t k = 0; k < 10; ++k) drive.seen[n - 10 + k] = drive.seen[6 + k];
  const RunReconstruction result = Solve(drive, true);
  EXPECT_GE(result.loops.found, 1);
  EXPECT_EQ(result.loops.closed, 0);
  EXPECT_EQ(result.loops.contradicting, result.loops.found);
}

}  // namespace
}  // namespace trigpoint
