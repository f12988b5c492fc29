// GPS against the place and the shape of a run round a square, as in docs/method.md section 5.
#include "localize/georegistration/gps_check.h"

#include <gmock/gmock.h>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kSigma_m = 3, kWander_s = 30, kSide_m = 25;

// Where the run is: round a square, a metre a second; its corners show the time.
Eigen::Vector3d PlaceAt(double second) {
  const int side = static_cast<int>(std::floor(second / kSide_m));
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (int k = 0; k <= std::max(side, 0); ++k) {
    const double angle = 0.5 * EIGEN_PI * k;
    place += (k < side ? kSide_m : second - kSide_m * k) * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
  }
  return place;
}

struct GpsRun {
  BundleProblem problem;
  std::vector<GpsPlace> gps;
  GeoRegistration geo;
};

// A fix a second for 80 s, whose errors wander; `late_s`: their times are that much too late.
GpsRun MakeRun(uint64_t seed, double late_s = 0, bool mirrored = false) {
  GpsRun run;
  Random random(seed);
  const double rho = std::exp(-1 / kWander_s);
  Eigen::Vector3d error(kSigma_m * random.Normal(), kSigma_m * random.Normal(), 0);
  for (int i = 0; i < 80; ++i) {
    const Rigid3d world_from_body(Eigen::Quaterniond::Identity(), PlaceAt(i));
    run.problem.poses.push_back(world_from_body.Inverse());
    GpsPlace fix;
    fix.pose = i;
    fix.stamp_ns = static_cast<int64_t>(i) * 1'000'000'000;
    fix.position = PlaceAt(i - late_s) + error;
    if (mirrored) fix.position.x() *= -1;
    fix.sigma_h_m = kSigma_m;
    run.gps.push_back(fix);
    const Eigen::Vector3d step(random.Normal(), random.Normal(), 0);
    error = rho * error + std::sqrt(1 - rho * rho) * kSigma_m * step;
  }
  run.geo.solved = true;
  run.geo.covariance.setIdentity();
  return run;
}

TEST(GpsShape, GoodGpsIsNotDoubted) {
  int doubted = 0;
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    GpsRun run = MakeRun(seed);
    CheckGpsShape(run.problem, run.gps, kWander_s, &run.geo);
    doubted += run.geo.solved ? 0 : 1;
  }
  EXPECT_LE(doubted, 3);  // 1 %
}

TEST(GpsShape, MirroredGpsIsWithheld) {
  int named = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    GpsRun run = MakeRun(seed, 0, true);
    CheckGpsShape(run.problem, run.gps, kWander_s, &run.geo);
    named += !run.geo.solved && run.geo.reason.find("east and west are exchanged") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 49);
}

TEST(GpsShape, ALateClockIsNamed) {
  int named = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    GpsRun run = MakeRun(seed, 12);
    CheckGpsShape(run.problem, run.gps, kWander_s, &run.geo);
    named += !run.geo.solved && run.geo.reason.find("gps.time_offset_s") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 40);  // where its errors wander along with the run, nothing shows it
}

TEST(GpsPlace, GpsThatAgreesIsNotMentioned) {
  GpsRun run = MakeRun(1);
  HeedGps(run.problem, run.gps, &run.geo);
  EXPECT_TRUE(run.geo.solved);
  EXPECT_THAT(run.geo.reason, IsEmpty());
  EXPECT_TRUE(run.geo.covariance.isIdentity());
}

TEST(GpsPlace, ADistantRunHasTheDistanceInItsSigmas) {
  GpsRun run = MakeRun(1);
  for (GpsPlace& fix : run.gps) fix.position += Eigen::Vector3d(300, 400, 0);
  HeedGps(run.problem, run.gps, &run.geo);
  EXPECT_TRUE(run.geo.solved);
  EXPECT_THAT(run.geo.reason, HasSubstr("GPS lies 500 m from the run"));
  EXPECT_NEAR(std::sqrt(run.geo.covariance(3, 3)), 300, 10);
  EXPECT_NEAR(std::sqrt(run.geo.covariance(4, 4)), 400, 10);
}

TEST(GpsPlace, ATurnedRunIsWithheld) {
  GpsRun run = MakeRun(1);
  for (GpsPlace& fix : run.gps) fix.position = ExpSO3({0, 0, 2}) * fix.position;
  HeedGps(run.problem, run.gps, &run.geo);
  EXPECT_FALSE(run.geo.solved);
  EXPECT_THAT(run.geo.reason, HasSubstr("in the run's direction"));
}

}  // namespace
}  // namespace trigpoint
