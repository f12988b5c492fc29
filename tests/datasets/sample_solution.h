// A small solution with everything that one can hold.
#pragma once

#include <cmath>
#include <memory>
#include <string>

#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

// A body with two cameras goes along a row of points, with odometry; two references, one of them localized.
inline Solution MakeSolution() {
  Random random(7);
  Solution s;
  s.run = "run \"1\", ä";
  for (const char* name : {"cam0", "cam1"}) {
    BodyCamera camera;
    camera.name = name;
    camera.camera = Camera(CameraModel::kRadtan, 640, 480, {500.1, 501.2, 319.5, 239.5, 0.01, -0.002, 1e-4, -1e-5});
    camera.cam_from_body = Rigid3d(ExpSO3({1.2, -1.2, 1.2 + 0.3 * (name[3] - '0')}), {0.1, 0.0, 0.2});
    camera.has_extrinsics = true;
    camera.time_offset_s = -0.0;
    s.cameras.push_back(camera);
    s.problem.views.push_back(camera.cam_from_body);
  }
  for (int k = 0; k < 6; ++k) {
    const Rigid3d odom_from_body(ExpSO3({0, 0, 0.05 * k}), {0.7 * k, 0.02 * k * k, 0});
    s.problem.poses.push_back(odom_from_body.Inverse());
    s.problem.pose_constant.push_back(k == 0);
    s.pose_stamps.push_back(1'600'000'000'000'000'001 + 500'000'000LL * k);
    for (int c = 0; c < 2; ++c) s.images.push_back({s.pose_stamps.back(), std::to_string(k) + "é.jpg", c, k});
    if (k == 0) continue;
    PoseFactor f;
    f.kind = PoseFactor::Kind::kBetween;
    f.a = k - 1, f.b = k;
    f.scale = 0;
    f.measured = s.problem.poses[static_cast<size_t>(k) - 1] * odom_from_body;
    f.sqrt_info = Vector6d(Vector6d::Constant(50)).asDiagonal();
    f.loss = std::make_shared<HuberChi2Loss>(22.5);
    f.weight = 0.1 + 0.2;
    s.problem.factors.push_back(f);
  }
  PoseFactor between = s.problem.factors.front();
  between.kind = PoseFactor::Kind::kTwoView;
  between.measured.translation.normalize();
  between.view_b = 1;
  s.problem.factors.push_back(between);
  PoseFactor antenna;
  antenna.kind = PoseFactor::Kind::kPosition;
  antenna.a = 5;
  antenna.arm = {0.1, -0.2, 1};
  antenna.measured.translation = s.problem.poses[5].Inverse() * antenna.arm;
  s.problem.factors.push_back(antenna);
  s.problem.poses.push_back(Rigid3d(ExpSO3({0.1, 0.2, 0.3}), {-2, 1, 0.5}));  // of the localized reference
  s.problem.pose_constant.push_back(false);
  s.problem.views.push_back(Rigid3d());
  s.problem.loss = MakeLoss("dcs", 5.99 / 3);
  s.problem.scales = {{1.01, true, 1, 0.02}};
  for (int j = 0; j < 40; ++j) {
    s.problem.points.push_back({-1 + 0.2 * j, 3 + random.Normal(), random.Normal()});
    s.depth_m.push_back(2 + 0.1 * j);
    s.point_valid.push_back(true);
    for (size_t i = 0; i <= s.images.size(); ++i) {
      const bool own = i < s.images.size();
      BearingObservation o;
      o.point = j;
      o.pose = own ? s.images[i].pose : 6;
      o.view = own ? s.images[i].camera : 2;
      const Rigid3d view_from_odom =
          s.problem.views[static_cast<size_t>(o.view)] * s.problem.poses[static_cast<size_t>(o.pose)];
      const Eigen::Vector3d ray = (view_from_odom * s.problem.points.back()).normalized();
      o.ray = ray.cast<float>();
      const Eigen::Vector3d across = ray.unitOrthogonal();
      o.w.row(0) = (500 * across).cast<float>().transpose();
      o.w.row(1) = (500 * ray.cross(across)).cast<float>().transpose();
      o.active = (i + static_cast<size_t>(j)) % 7 != 0;
      s.problem.observations.push_back(o);
      s.image_of.push_back(own ? static_cast<int>(i) : -1 - 1);
      s.feature_of.push_back(1000 * j + static_cast<int>(i));
    }
  }
  s.sigma_px = 1.0 / 3;
  s.correlation_inflation = 1.7;
  s.odometry_noise_factor << 1, 2, 3, 4, 5, 6e-300;
  s.summary = {10.5, 1e-310, 12, true};
  s.counts = {{"tracks", 40}, {"pairs", 15}};
  for (size_t k = 0; k < s.problem.poses.size(); ++k) {
    Matrix6d m;
    for (double& v : m.reshaped()) v = 0.01 * random.Normal();
    s.covariances.push_back(m * m.transpose());
  }
  s.references.resize(2);
  s.references[0].name = "p0", s.references[0].status = "rejected", s.references[0].reason = "chance";
  s.references[1].name = "p1", s.references[1].status = "localized", s.references[1].pose = 6;
  s.references[1].row = "photos/a", s.references[1].support = 33.25, s.references[1].geotag = "ok",
  s.references[1].geotag_difference = {1, -0.0, 3};
  SolutionGeoreference& geo = s.georeference.emplace();
  geo.source = "geotags";
  geo.origin = {48.1, 11.5, 500.25};
  geo.world_from_odom = {1.02, Eigen::Quaterniond(ExpSO3({0.01, 0.02, 1.5})), {10, -20, 3}};
  Eigen::Matrix<double, 7, 7> m;
  for (double& v : m.reshaped()) v = 0.02 * random.Normal();
  geo.covariance = m * m.transpose();
  geo.with_poses.resize(s.problem.poses.size());
  for (auto& block : geo.with_poses) {
    for (double& v : block.reshaped()) v = 1e-5 * random.Normal();
  }
  return s;
}

}  // namespace trigpoint
