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

// The same speed on an arc: shifted along itself, it stays the same arc.
Eigen::Vector3d PlaceOnArcAt(double second) {
  constexpr double kRadius_m = 60;
  return kRadius_m * Eigen::Vector3d(std::cos(second / kRadius_m) - 1, std::sin(second / kRadius_m), 0);
}

// The same speed ahead, weaving: within a few seconds the path bends to either side and back.
Eigen::Vector3d PlaceWeavingAt(double second) {
  constexpr double kAside_m = 2;
  const auto aside = [&](double period_s) -> double { return kAside_m * std::sin(2 * EIGEN_PI * second / period_s); };
  return {second, aside(7.3) + aside(11.9), 0};
}

GeoRegistrationOptions Wandering() {
  GeoRegistrationOptions options;
  options.gps_correlation_s = kWander_s;
  return options;
}

struct GpsRun {
  BundleProblem problem;
  std::vector<GpsPlace> gps;
  GeoRegistration geo;
};

// A fix a second for 80 s, whose errors wander; `late_s`: their times are that much too late.
GpsRun MakeRun(uint64_t seed, double late_s = 0, bool mirrored = false,
               Eigen::Vector3d (*place_at)(double second) = PlaceAt, double sigma_m = kSigma_m) {
  GpsRun run;
  Random random(seed);
  const double rho = std::exp(-1 / kWander_s);
  Eigen::Vector3d error(sigma_m * random.Normal(), sigma_m * random.Normal(), 0);
  for (int i = 0; i < 80; ++i) {
    const Rigid3d world_from_body(Eigen::Quaterniond::Identity(), place_at(i));
    run.problem.poses.push_back(world_from_body.Inverse());
    GpsPlace fix;
    fix.pose = i;
    fix.stamp_ns = static_cast<int64_t>(i) * 1'000'000'000;
    fix.position = place_at(i - late_s) + error;
    if (mirrored) fix.position.x() *= -1;
    fix.sigma_h_m = sigma_m;
    run.gps.push_back(fix);
    const Eigen::Vector3d step(random.Normal(), random.Normal(), 0);
    error = rho * error + std::sqrt(1 - rho * rho) * sigma_m * step;
  }
  run.geo.solved = true;
  run.geo.covariance.setIdentity();
  return run;
}

TEST(GpsShape, GoodGpsIsNotDoubted) {
  int doubted = 0;
  for (uint64_t seed = 1; seed <= 300; ++seed) {
    GpsRun run = MakeRun(seed);
    CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
    doubted += run.geo.solved ? 0 : 1;
  }
  EXPECT_LE(doubted, 3);  // 1 %
}

TEST(GpsShape, MirroredGpsIsWithheld) {
  int named = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    GpsRun run = MakeRun(seed, 0, true);
    CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
    named += !run.geo.solved && run.geo.reason.find("east and west are exchanged") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 49);
}

TEST(GpsShape, ALateClockIsNamed) {
  int named = 0;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    GpsRun run = MakeRun(seed, 12);
    CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
    named += !run.geo.solved && run.geo.reason.find("gps.time_offset_s") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(named, 40);  // where its errors wander along with the run, nothing shows it
}

// Fixes that say something new are seconds apart. Between them the run is where its poses are, not on a straight line.
TEST(GpsShape, TheOffsetNamedIsRightOnAPathThatBendsBetweenFixes) {
  constexpr double kGood_m = 0.3;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    // Three seconds also make the path look a little like its mirror image.
    for (const auto& [late_s, named] : {std::pair(2.5, "about -2.5 s added"), {3.0, "about -3.0 s added"}}) {
      GpsRun run = MakeRun(seed, late_s, false, PlaceWeavingAt, kGood_m);
      CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
      EXPECT_THAT(run.geo.reason, HasSubstr(named));
    }
    GpsRun right = MakeRun(seed, 0, false, PlaceWeavingAt, kGood_m);
    CheckGpsShape(right.problem, right.gps, Wandering(), true, &right.geo);
    EXPECT_TRUE(right.geo.solved);
  }
}

// Variance of the run's place along its path, m^2, in the middle of the arc, where the path goes along y by 2/3 rad.
double AlongArc(const Eigen::Matrix<double, 7, 7>& covariance) {
  const Eigen::Vector3d place = PlaceOnArcAt(40);
  const Eigen::Vector2d along(-std::sin(2.0 / 3), std::cos(2.0 / 3));
  Eigen::Matrix<double, 2, 3> by;
  by << -place.y(), 1, 0, place.x(), 0, 1;
  return along.dot(by * covariance.block<3, 3>(2, 2) * by.transpose() * along);
}

TEST(GpsClock, IsPartOfTheSigmasOnAnArc) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    GpsRun run = MakeRun(seed, 0, false, PlaceOnArcAt);
    run.geo.covariance *= 1e-6;
    CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
    EXPECT_TRUE(run.geo.solved);
    EXPECT_THAT(run.geo.reason, HasSubstr("gps_clock_doubt"));
    // One recording in ten is off by up to 20 s, at a metre a second: 3.7 m, more or less by what GPS excludes.
    EXPECT_NEAR(std::sqrt(AlongArc(run.geo.covariance)), 3.7, 1.5);
  }
}

TEST(GpsClock, IsSeenAtCorners) {
  constexpr double kGood_m = 0.3;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    GpsRun run = MakeRun(seed, 0, false, PlaceAt, kGood_m);
    run.geo.covariance *= kGood_m * kGood_m;
    CheckGpsShape(run.problem, run.gps, Wandering(), true, &run.geo);
    EXPECT_THAT(run.geo.reason, IsEmpty());
    // Half a second, the step of the search, at a metre a second.
    EXPECT_LT(run.geo.covariance.block(3, 3, 2, 2).trace(), 2 * kGood_m * kGood_m + 0.25);
  }
}

TEST(GpsClock, IsTrustedWhereItIsSaidOrGeotagsHoldTheRun) {
  GpsRun run = MakeRun(1, 0, false, PlaceOnArcAt);
  GeoRegistrationOptions synchronised = Wandering();
  synchronised.gps_clock_doubt = 0;
  CheckGpsShape(run.problem, run.gps, synchronised, true, &run.geo);
  CheckGpsShape(run.problem, run.gps, Wandering(), false, &run.geo);
  EXPECT_THAT(run.geo.reason, IsEmpty());
  EXPECT_TRUE(run.geo.covariance.isIdentity());
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

// Over a few metres the errors of GPS turn the run by any angle: that is no contradiction.
TEST(GpsPlace, AShortRunFarFromGpsIsNotTurned) {
  const auto nearly_still = [](double second) { return Eigen::Vector3d(0.05 * second, 0, 0); };
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    GpsRun run = MakeRun(seed, 0, false, nearly_still);
    for (GpsPlace& fix : run.gps) fix.position += Eigen::Vector3d(300, 400, 0);
    HeedGps(run.problem, run.gps, &run.geo);
    EXPECT_TRUE(run.geo.solved);
    EXPECT_THAT(run.geo.reason, HasSubstr("m from the run"));
    EXPECT_EQ(run.geo.covariance(2, 2), 1);
    EXPECT_GT(run.geo.covariance(3, 3), 280 * 280);
  }
}

// Where only heights differ, the plan is as well known as before: what GPS errs by there is no contradiction.
TEST(GpsPlace, ARunBelowGpsIsUncertainInHeightOnly) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    GpsRun run = MakeRun(seed);
    const Eigen::Matrix<double, 7, 7> before = run.geo.covariance;
    for (GpsPlace& fix : run.gps) fix.position.z() += 47;
    HeedGps(run.problem, run.gps, &run.geo);
    EXPECT_TRUE(run.geo.solved);
    EXPECT_THAT(run.geo.reason, HasSubstr("GPS lies 47 m above the run"));
    Eigen::Matrix<double, 7, 7> expected = before;
    expected(5, 5) += 47 * 47;
    EXPECT_TRUE(run.geo.covariance.isApprox(expected, 1e-12));
  }
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
