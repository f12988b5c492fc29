#include "calib/target/hand_eye.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "calib/base/error.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

ProgressSink progress;
CancelToken cancel;
constexpr double kSize = 0.4;

const Camera kCamera = Camera::FromFieldOfView(960, 600, 1.7);

Rigid3d Truth() {
  Eigen::Matrix3d forward;
  forward << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Quaterniond r = ExpSO3({0.03, -0.1, 0.02}) * Eigen::Quaterniond(forward);
  return {r, -(r * Eigen::Vector3d(0.4, 0.1, 1.2))};
}

// A drive past eight tags, each seen along an arc; the body rocks by `rocking` (rad).
std::vector<HandEyeSight> Drive(double rocking, double sigma_px, double odometry_sigma, Random& random) {
  std::vector<HandEyeSight> sights;
  const Rigid3d cam_from_body = Truth();
  for (int tag = 0; tag < 8; ++tag) {
    const Eigen::Vector3d place(10.0 * tag, 4 + tag % 3, 1.0 + 0.2 * (tag % 2));
    Eigen::Matrix3d facing;  // the tag's z, into it, along +y of the world; its y down
    facing << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    const Rigid3d world_from_tag(Eigen::Quaterniond(facing), place);
    for (int i = 0; i < 20; ++i) {
      const double s = i / 19.0;
      const Eigen::Vector3d at = place + Eigen::Vector3d(-2.5 + 3 * s, -5 - 0.5 * std::sin(3 * s + tag), -place.z());
      const double yaw = std::numbers::pi / 2 - 0.5 + 0.9 * s + 0.1 * std::sin(tag);
      const Eigen::Quaterniond turn = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(rocking * std::sin(2.0 * i + tag), Eigen::Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(rocking * std::cos(3.0 * i), Eigen::Vector3d::UnitX());
      const Rigid3d world_from_body(turn, at);
      HandEyeSight sight;
      sight.stamp_ns = (tag * 100 + i) * 100'000'000LL;
      sight.tag_id = tag;
      sight.odom_from_body = world_from_body;
      for (int a = 0; a < 3; ++a) sight.odom_from_body.translation[a] += odometry_sigma * random.Normal();
      bool seen = true;
      for (size_t k = 0; k < 4; ++k) {
        sight.corners_m[k] = {(k == 1 || k == 2 ? 0.5 : -0.5) * kSize, (k < 2 ? 0.5 : -0.5) * kSize, 0};
        const auto pixel =
            kCamera.Project(cam_from_body * (world_from_body.Inverse() * (world_from_tag * sight.corners_m[k])));
        seen = seen && pixel && kCamera.Contains(*pixel);
        if (seen) sight.pixels[k] = *pixel + sigma_px * Eigen::Vector2d(random.Normal(), random.Normal());
      }
      if (seen) sights.push_back(sight);
    }
  }
  return sights;
}

TEST(HandEye, RecoversTheMountFromAnyStart) {
  Random random(4);
  const std::vector<HandEyeSight> sights = Drive(0.15, 0.05, 0, random);
  ASSERT_GT(sights.size(), 80u);
  const HandEyeResult result = CalibrateHandEye(sights, kCamera, Rigid3d(), {}, progress, cancel);
  const Vector6d error = result.cam_from_body.Minus(Truth());
  EXPECT_LT(error.head<3>().norm(), 0.002);
  EXPECT_LT(error.tail<3>().norm(), 0.02);
  EXPECT_EQ(result.unseen_body.norm(), 0);
  EXPECT_NEAR(result.scale, 1, 0.005);
}

TEST(HandEye, ItsSigmasAreOfTheRightSize) {
  Random random(8);
  const std::vector<HandEyeSight> sights = Drive(0.15, 0.05, 0.004, random);
  const HandEyeResult result = CalibrateHandEye(sights, kCamera, Truth(), {}, progress, cancel);
  const Vector6d error = result.cam_from_body.Minus(Truth());
  const Vector6d sigma = result.covariance.diagonal().cwiseSqrt();
  for (int i = 0; i < 6; ++i) EXPECT_LT(std::abs(error[i]), 4 * sigma[i]) << i;
  EXPECT_LT(sigma.tail<3>().norm(), 0.2);
}

TEST(HandEye, SaysWhatAPlaneDoesNotShow) {
  Random random(4);
  const HandEyeResult result = CalibrateHandEye(Drive(0, 0.05, 0, random), kCamera, Truth(), {}, progress, cancel);
  EXPECT_NEAR(std::abs(result.unseen_body.z()), 1, 0.01);
  const Matrix6d covariance = InverseCovariance(result.cam_from_body, result.covariance);
  EXPECT_GT(std::sqrt(covariance(5, 5)), 0.9);  // the prior's metre
  EXPECT_LT(std::sqrt(covariance(3, 3)), 0.1);
}

TEST(HandEye, RefusesTooLittle) {
  Random random(4);
  std::vector<HandEyeSight> sights = Drive(0.1, 0.05, 0, random);
  sights.resize(30);
  try {
    CalibrateHandEye(sights, kCamera, Truth(), {}, progress, cancel);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("at least 4 stretches"));
  }
}

}  // namespace
}  // namespace trigpoint
