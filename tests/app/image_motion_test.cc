// The motion of a run without odometry: how long it is.
#include "app/pipeline/image_motion.h"

#include <gtest/gtest.h>

#include <algorithm>

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

}  // namespace
}  // namespace trigpoint
