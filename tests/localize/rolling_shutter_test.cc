// A hand-held camera whose rows are exposed one after the other, on a walk along which it swings.
#include "localize/reconstruct/rolling_shutter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "datasets/io/motion_rates.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

constexpr double kReadout_s = 0.03;

// 6 s along a street at 1.4 m/s; heading and pitch swing by up to 0.5 and 0.25 rad/s.
Rigid3d PoseAt(double t) {
  const Eigen::AngleAxisd heading(0.12 * std::sin(4 * t), Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd pitch(0.05 * std::sin(5 * t + 1), Eigen::Vector3d::UnitY());
  return {Eigen::Quaterniond(heading * pitch), Eigen::Vector3d(1.4 * t, 0.1 * std::sin(3 * t), 0.03 * std::sin(6 * t))};
}

// The camera's pixel of a point whose row is exposed when it shows it; nothing outside of the picture.
std::optional<Eigen::Vector2d> RolledPixel(const BodyCamera& camera, double readout_s, double t,
                                           const Eigen::Vector3d& point) {
  double row_time = 0;
  std::optional<Eigen::Vector2d> pixel;
  for (int i = 0; i < 10; ++i) {
    pixel = camera.camera.Project(camera.cam_from_body * (PoseAt(t + row_time).Inverse() * point));
    if (!pixel || !camera.camera.Contains(*pixel)) return std::nullopt;
    row_time = readout_s * RowOffset(camera.camera, pixel->y());
  }
  return pixel;
}

struct Walk {
  LocalizeInput input;
  std::vector<FeatureSet> features;
  std::vector<Rigid3d> truth;  // odom_from_body
};

// `stated_s`: the readout time that the calibration states.
Walk MakeWalk(double readout_s, double stated_s, uint64_t seed) {
  Walk walk;
  Random random(seed);
  BodyCamera camera;
  camera.name = "cam0";
  camera.camera = Camera::FromFieldOfView(960, 600, 1.2);
  Eigen::Matrix3d cam_from_body;  // looks 45 deg to the left
  cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  camera.cam_from_body = {
      Eigen::Quaterniond(cam_from_body * Eigen::AngleAxisd(-0.25 * EIGEN_PI, Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d(0.1, 0, 0)};
  camera.readout_s = stated_s;
  walk.input.cameras = {camera};
  std::vector<Eigen::Vector3d> points;
  for (int j = 0; j < 700; ++j) {
    points.emplace_back(random.Uniform(-5, 20), random.Uniform() < 0.5 ? random.Uniform(3, 5) : random.Uniform(5, 15),
                        random.Uniform(-1.5, 4));
  }
  Trajectory odometry;  // of 100 Hz: its noise is that of a walk
  Rigid3d drifted = PoseAt(0);
  for (int k = 0; k <= 600; ++k) {
    if (k > 0) {
      const Eigen::Vector3d turn(random.Normal(), random.Normal(), random.Normal());
      const Eigen::Vector3d way(random.Normal(), random.Normal(), random.Normal());
      drifted =
          drifted * (PoseAt(0.01 * (k - 1)).Inverse() * PoseAt(0.01 * k)) * Rigid3d(ExpSO3(1e-4 * turn), 1e-3 * way);
    }
    odometry.poses.push_back({10'000'000LL * k, drifted});
  }
  for (int i = 0; i <= 60; ++i) {
    const int64_t stamp = 100'000'000LL * i;
    walk.input.pose_stamps.push_back(stamp);
    walk.input.odom_from_body.push_back(*odometry.At(stamp, 20'000'000));
    walk.input.images.push_back({stamp, std::to_string(i), 0, i});
    walk.truth.push_back(PoseAt(0.1 * i));
    FeatureSet& seen = walk.features.emplace_back();
    std::vector<uint64_t> spots;
    for (size_t j = 0; j < points.size(); ++j) {
      const auto pixel = RolledPixel(camera, readout_s, 0.1 * i, points[j]);
      if (!pixel) continue;
      const Eigen::Vector2d noisy = *pixel + 0.3 * Eigen::Vector2d(random.Normal(), random.Normal());
      seen.points.push_back(noisy.cast<float>());
      seen.scales.push_back(4);
      seen.angles.push_back(0);
      spots.push_back(j);
    }
    seen.descriptors = cv::Mat::zeros(static_cast<int>(spots.size()), 128, CV_8U);
    for (size_t j = 0; j < spots.size(); ++j) {
      test::FillDescriptor(spots[j], static_cast<uint64_t>(i), seen.descriptors.ptr<uint8_t>(static_cast<int>(j)));
    }
  }
  walk.input.body_rates = RatesAt(odometry, walk.input.pose_stamps);
  return walk;
}

RunReconstruction Solve(Walk& walk) {
  walk.input.image_features = [&walk](int i) {
    const auto at = static_cast<size_t>(i);
    return AtImageTime(walk.features[at], walk.input.cameras[0], walk.input.body_rates[at]);
  };
  ReconstructRunOptions options;
  options.loops.close = false;
  ProgressSink progress;
  return ReconstructRun(walk.input, options, false, 2, 1, progress, {});
}

// RMSE over steps of one second, m.
double Error(const Walk& walk, const RunReconstruction& run) {
  const std::vector<Rigid3d>& poses = run.reconstruction.problem.poses;
  double sum = 0;
  size_t n = 0;
  for (size_t k = 0; k + 10 < poses.size(); k += 10, ++n) {
    const Rigid3d truth = walk.truth[k].Inverse() * walk.truth[k + 10];
    sum += (poses[k] * poses[k + 10].Inverse()).Minus(truth).tail<3>().squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(n));
}

TEST(RollingShutter, OfAKnownReadoutTimeCostsLittleAccuracy) {
  double global_m = 0, stated_m = 0, ignored_m = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Walk global = MakeWalk(0, 0, seed), stated = MakeWalk(kReadout_s, kReadout_s, seed),
         ignored = MakeWalk(kReadout_s, 0, seed);
    const RunReconstruction best = Solve(global), with = Solve(stated), without = Solve(ignored);
    EXPECT_LT(with.reconstruction.sigma_px, 1.1 * best.reconstruction.sigma_px) << seed;
    EXPECT_GT(without.reconstruction.sigma_px, 2 * best.reconstruction.sigma_px) << seed;
    global_m += Error(global, best), stated_m += Error(stated, with), ignored_m += Error(ignored, without);
  }
  EXPECT_LT(stated_m, 1.3 * global_m);
  EXPECT_GT(ignored_m, 1.8 * global_m);
}

TEST(RollingShutter, ItsReadoutTimeIsSeenByTheImages) {
  for (const auto& [readout_s, stated_s] : {std::pair(kReadout_s, 0.0), {-0.02, -0.01}, {0.0, 0.0}}) {
    Walk walk = MakeWalk(readout_s, stated_s, 2);
    const RunReconstruction run = Solve(walk);
    ASSERT_EQ(run.readout.size(), 1u);
    EXPECT_NEAR(run.readout[0].readout_s, readout_s, 4 * run.readout[0].sigma_s);
    EXPECT_LT(run.readout[0].sigma_s, 0.003);
  }
}

// The turn of far points, and the way of near ones, forwards: what a row sees later is moved back.
TEST(RollingShutter, PixelsAreThoseOfTheImagesTime) {
  BodyCamera camera;
  camera.camera = Camera::FromFieldOfView(960, 600, 1.2);
  const Rigid3d now = PoseAt(1);
  const MotionRate rate = RateOfCamera(RateBetween(PoseAt(0.99), PoseAt(1.01), now, 0.02), camera.cam_from_body);
  for (const Eigen::Vector3d& in_cam : {Eigen::Vector3d(1, 1.5, 5), Eigen::Vector3d(-20, -15, 50)}) {
    const Eigen::Vector3d point = now * (camera.cam_from_body.Inverse() * in_cam);
    const auto rolled = RolledPixel(camera, kReadout_s, 1, point);
    ASSERT_TRUE(rolled);
    const Eigen::Vector2d exact = *camera.camera.Project(in_cam);
    EXPECT_GT((*rolled - exact).norm(), 1);
    EXPECT_LT((PixelAtImageTime(camera.camera, kReadout_s, *rolled, rate, 1 / in_cam.norm()) - exact).norm(), 0.05);
  }
}

TEST(RollingShutter, RatesAreUnknownWhereStepsAreLong) {
  Trajectory sparse;
  for (int k = 0; k < 10; ++k) sparse.poses.push_back({2'000'000'000LL * k, PoseAt(2.0 * k)});
  for (const MotionRate& rate : RatesAt(sparse, {4'000'000'000})) EXPECT_FALSE(rate.known);
}

}  // namespace
}  // namespace trigpoint
