// A drive round the middle of a yard whose walls are full of spots, with odometry that has noise and drifts.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "calib/geo/geodetic.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "tests/localize/test_scene.h"

namespace trigpoint::test {

struct Drive {
  LocalizeInput input;
  std::vector<Rigid3d> odom_from_body;  // truth
  std::vector<SeenFeatures> seen;
};

// One lap and a bit in the middle of a yard whose walls are full of spots. Odometry: white noise, a heading that
// drifts, a scale of 1. `laps` < 1: it does not come back. `step`: between images, m. `radius`: of the path, m.
inline Drive MakeDrive(double laps, uint64_t seed, double step = 0.5, double radius = 8) {
  Drive drive;
  Random random(seed);
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
  const auto count = static_cast<uint64_t>(2500 * radius / 8);
  for (uint64_t j = 0; j < count; ++j) {
    const double a = random.Uniform(0, 2 * EIGEN_PI), r = random.Uniform(radius + 5, radius + 8);
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
    drive.seen.push_back(See(camera, body_camera.cam_from_body * world_from_body.Inverse(), points, spots, 14, 0.7,
                             static_cast<uint64_t>(k) + 100 * seed));
  }
  return drive;
}

// The same drive with a second camera that sees the same and whose clock is `late_ns` late: each of its images has a
// body pose of its own, up to which nothing has moved.
inline Drive WithLateCamera(const Drive& drive, int64_t late_ns) {
  Drive two;
  two.input.cameras = {drive.input.cameras.front(), drive.input.cameras.front()};
  two.input.cameras.back().name = "cam1";
  for (size_t k = 0; k < drive.seen.size(); ++k) {
    for (const int camera : {0, 1}) {
      const int64_t stamp = drive.input.pose_stamps[k] + camera * late_ns;
      two.input.images.push_back(
          {stamp, std::to_string(k) + "_" + std::to_string(camera), camera, static_cast<int>(two.seen.size())});
      two.input.pose_stamps.push_back(stamp);
      two.input.odom_from_body.push_back(drive.input.odom_from_body[k]);
      two.odom_from_body.push_back(drive.odom_from_body[k]);
      two.seen.push_back(drive.seen[k]);
    }
  }
  return two;
}

// RMSE of body positions relative to the first pose, m.
inline double Error(const Drive& drive, const std::vector<Rigid3d>& body_from_odom) {
  double sum = 0;
  for (size_t k = 0; k < body_from_odom.size(); ++k) {
    const Rigid3d truth = drive.odom_from_body[0].Inverse() * drive.odom_from_body[k];
    sum += (body_from_odom[k].TargetOriginInSource() - truth.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(body_from_odom.size()));
}

}  // namespace trigpoint::test
