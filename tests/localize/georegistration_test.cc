// The run's frame on the Earth: recovers what it was made from, with an uncertainty that redraws confirm.
#include "localize/georegistration/georegistration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "calib/base/median.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kScale = 1.012;

struct Site {
  Sim3d world_from_odom;
  std::vector<GeoObservation> observations;
  Eigen::MatrixXd odom_covariance;
};

// Eight panoramas round a lot; geotags of 0.3 m, 0.5 m, 1 deg, 0.3 deg; places known to 3 cm and 0.1 deg each.
Site MakeSite(uint64_t seed, double outlier_m) {
  Site site;
  Random random(seed);
  site.world_from_odom = {kScale, ExpSO3({0.01, -0.02, 1.1}), Eigen::Vector3d(4, -7, 1.5)};
  const auto normal3 = [&](double s) {
    return Eigen::Vector3d(s * random.Normal(), s * random.Normal(), s * random.Normal());
  };
  const Sim3d odom_from_world = site.world_from_odom.Inverse();
  const double place_m = 0.03, place_rad = 0.1 * kDegToRad;
  for (int i = 0; i < 8; ++i) {
    const double a = 0.25 * EIGEN_PI * i;
    const Attitude true_attitude{a, 0.02, -0.01};
    const Rigid3d world_from_rig(WorldFromCamRotation(true_attitude),
                                 Eigen::Vector3d(15 * std::cos(a), 10 * std::sin(a), 0.2 * i));
    GeoObservation o;
    o.odom_from_rig = odom_from_world.TransformPose(world_from_rig);
    o.odom_from_rig.rotation = ExpSO3(normal3(place_rad)) * o.odom_from_rig.rotation;
    o.odom_from_rig.translation += normal3(place_m);
    o.position = world_from_rig.translation +
                 Eigen::Vector3d(0.3 * random.Normal(), 0.3 * random.Normal(), 0.5 * random.Normal());
    if (i == 3) o.position.x() += outlier_m;
    o.has_heading = o.has_tilt = true;
    o.attitude = {true_attitude.heading_rad + kDegToRad * random.Normal(),
                  true_attitude.pitch_rad + 0.3 * kDegToRad * random.Normal(),
                  true_attitude.roll_rad + 0.3 * kDegToRad * random.Normal()};
    o.sigma_h_m = 0.3, o.sigma_v_m = 0.5, o.sigma_heading_rad = kDegToRad, o.sigma_tilt_rad = 0.3 * kDegToRad;
    site.observations.push_back(o);
  }
  Eigen::VectorXd diagonal(48);
  for (int i = 0; i < 8; ++i) {
    diagonal.segment<3>(6 * i).setConstant(place_rad * place_rad);
    diagonal.segment<3>(6 * i + 3).setConstant(place_m * place_m);
  }
  site.odom_covariance = diagonal.asDiagonal();
  return site;
}

Eigen::Matrix<double, 7, 1> ErrorOf(const GeoRegistration& geo, const Sim3d& truth) {
  Eigen::Matrix<double, 7, 1> e;
  e << LogSO3(geo.world_from_odom.rotation * truth.rotation.conjugate()),
      geo.world_from_odom.translation - truth.translation, geo.world_from_odom.scale - truth.scale;
  return e;
}

// Each unknown is within so many of its stated sigmas of the truth.
void ExpectWithin(double sigmas, const GeoRegistration& geo, const Site& site) {
  const Eigen::Matrix<double, 7, 1> e = ErrorOf(geo, site.world_from_odom);
  for (int k = 0; k < 7; ++k) EXPECT_LT(std::abs(e(k)), sigmas * std::sqrt(geo.covariance(k, k))) << k;
}

TEST(GeoRegistration, NamesTheGeotagThatIsOff) {
  const Site site = MakeSite(1, 7);
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  for (size_t i = 0; i < 8; ++i) EXPECT_EQ(geo.outlier[i], i == 3) << i;
  EXPECT_NEAR(geo.residuals[3].x(), 7, 1.2);
  ExpectWithin(5, geo, site);
}

// Twenty positions of one source with three times the stated error, one of them wrong, and five of the user's.
TEST(GeoRegistration, SigmasOfASourceAreEstimatedFromItsPositions) {
  constexpr double kTrue_m = 3, kStated_m = 1;
  double ratio = 0, mean_sigma = 0;
  constexpr int kDraws = 20;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    Random random(seed);
    const Sim3d world_from_odom = {1, ExpSO3({0, 0, 0.7}), Eigen::Vector3d(4, -7, 0)};
    std::vector<GeoObservation> observations;
    for (int i = 0; i < 25; ++i) {
      GeoObservation o;
      const Eigen::Vector3d at(4.0 * i, 10 * std::sin(0.5 * i), 0);
      o.odom_from_rig = Rigid3d(Eigen::Quaterniond::Identity(), world_from_odom.Inverse() * at);
      const double sigma = i < 20 ? kTrue_m : 0.3;
      o.position = at + sigma * Eigen::Vector3d(random.Normal(), random.Normal(), 0);
      o.has_height = false;
      o.sigma_h_m = i < 20 ? kStated_m : 0.3;
      if (i < 20) o.source = "mapillary";
      if (i == 7) o.position.x() += 60;
      observations.push_back(o);
    }
    const Eigen::MatrixXd known = 1e-6 * Eigen::MatrixXd::Identity(150, 150);
    const GeoRegistration geo = RegisterBySources(&observations, known, 1, 0.001, true, {});
    ASSERT_TRUE(geo.solved) << geo.reason;
    ASSERT_EQ(geo.sources.size(), 1u);
    EXPECT_EQ(geo.sources[0].source, "mapillary");
    EXPECT_EQ(geo.sources[0].positions, 20);
    EXPECT_EQ(geo.sources[0].stated_sigma_m, kStated_m);
    EXPECT_TRUE(geo.outlier[7]);
    EXPECT_NEAR(observations[0].sigma_h_m, geo.sources[0].sigma_m, 0.03 * geo.sources[0].sigma_m);
    EXPECT_EQ(observations[22].sigma_h_m, 0.3) << "the user's own statement stays";
    mean_sigma += geo.sources[0].sigma_m / kDraws;
    ratio += std::pow((geo.sources[0].sigma_m / kTrue_m - 1) / geo.sources[0].relative_sigma, 2) / kDraws;
  }
  EXPECT_NEAR(mean_sigma, kTrue_m, 0.25);
  EXPECT_GT(ratio, 0.5);
  EXPECT_LT(ratio, 2.0);
}

TEST(GeoRegistration, FewPositionsOfASourceAreTakenAsStated) {
  Site site = MakeSite(1, 0);
  for (GeoObservation& o : site.observations) o.source = "panoramax";
  std::vector<GeoObservation> observations = site.observations;
  const GeoRegistration geo = RegisterBySources(&observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved);
  EXPECT_EQ(geo.sources.at(0).sigma_m, 0);
  EXPECT_EQ(observations[0].sigma_h_m, 0.3);
  const GeoRegistration plain = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  EXPECT_EQ(geo.covariance, plain.covariance);
}

TEST(GeoRegistration, HeadingsThatCountAnotherWayAreTold) {
  const Site right = MakeSite(5, 6.0);
  EXPECT_FALSE(OtherHeadings(right.observations));
  const auto with = [&](auto&& change) {
    std::vector<GeoObservation> changed = right.observations;
    for (GeoObservation& o : changed) o.attitude.heading_rad = change(o.attitude.heading_rad);
    return OtherHeadings(changed).value_or("");
  };
  EXPECT_EQ(with([](double h) { return -h; }), "counter-clockwise from north");
  EXPECT_EQ(with([](double h) { return 0.5 * EIGEN_PI - h; }), "counter-clockwise from east");
  EXPECT_EQ(with([](double h) { return h - 0.5 * EIGEN_PI; }), "clockwise from east");
  EXPECT_EQ(with([](double h) { return h + EIGEN_PI; }), "clockwise from south (the direction behind the camera)");
  EXPECT_EQ(with([](double h) { return h * kDegToRad; }), "in radians");
  EXPECT_EQ(with([](double h) { return 2.5 * h + 1; }), "") << "nothing that could be named";
  EXPECT_FALSE(OtherHeadings({right.observations.begin(), right.observations.begin() + 3})) << "too few";
}

// The first panoramas of the site, with every so many metres' reach.
struct Few {
  std::vector<GeoObservation> observations;
  Eigen::MatrixXd covariance;
  GeoRegistration Fit() const { return RegisterToEarth(observations, covariance, 1, 0.01, false, {}); }
};
Few FirstOf(const Site& site, int count) {
  return {{site.observations.begin(), site.observations.begin() + count},
          site.odom_covariance.topLeftCorner(6 * count, 6 * count)};
}

double HorizontalError(const GeoRegistration& geo, const Site& site, const GeoObservation& o) {
  const Eigen::Vector3d& p = o.odom_from_rig.translation;
  return (geo.world_from_odom * p - site.world_from_odom * p).head<2>().norm();
}

TEST(GeoRegistration, OneGeotagFarOffDisplacesNothing) {
  for (const double off_m : {30.0, 100.0, 1000.0, 50'000.0}) {
    for (const bool headings : {true, false}) {
      const Site site = MakeSite(7, 0);
      Few few = FirstOf(site, 4);
      few.observations[2].position.y() += off_m;
      for (GeoObservation& o : few.observations) o.has_heading = o.has_tilt = headings;
      const GeoRegistration geo = few.Fit();
      ASSERT_TRUE(geo.solved) << geo.reason << off_m << headings;
      for (size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(geo.outlier[i], i == 2) << off_m;
        EXPECT_LT(HorizontalError(geo, site, few.observations[i]), 1.5) << off_m << " " << headings;
      }
    }
  }
}

TEST(GeoRegistration, TwoGeotagsThatContradictEachOtherDecideNothing) {
  const Site site = MakeSite(8, 0);
  Few two = FirstOf(site, 2);
  two.observations[1].position.x() += 1000;
  EXPECT_FALSE(two.Fit().solved);
  EXPECT_NE(two.Fit().reason.find("contradict"), std::string::npos) << two.Fit().reason;
  Few four = FirstOf(site, 4);  // two and two
  for (const size_t i : {2U, 3U}) four.observations[i].position.x() += 1000;
  EXPECT_FALSE(four.Fit().solved);
  EXPECT_NE(four.Fit().reason.find("two solutions"), std::string::npos) << four.Fit().reason;
}

TEST(GeoRegistration, TwoGeotagsThatAgreeOutvoteNoThirdOne) {
  for (const bool two : {false, true}) {
    Few three = FirstOf(MakeSite(8, 0), 3);
    three.observations[1].position.y() += 10;
    if (two) three.observations[2].position.y() += 10;
    const GeoRegistration geo = three.Fit();
    EXPECT_FALSE(geo.solved) << two;
    EXPECT_NE(geo.reason.find("fewer than 3 agree"), std::string::npos) << geo.reason;
  }
}

TEST(GeoRegistration, HeadingsThatAreAllOffWidenTheTurn) {
  for (const double off_deg : {3.5, -3.5}) {
    Site site = MakeSite(5, 0);
    for (GeoObservation& o : site.observations) o.attitude.heading_rad += off_deg * kDegToRad;
    const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
    ASSERT_TRUE(geo.solved) << geo.reason;
    EXPECT_NE(geo.reason.find("headings and positions of the geotags contradict each other"), std::string::npos)
        << geo.reason;
    ExpectWithin(3, geo, site);
  }
}

// As of a receiver that never got a fix after its first.
TEST(GeoRegistration, PositionsThatAreAllOneAreNoOtherUnit) {
  Site site = MakeSite(7, 0);
  for (GeoObservation& o : site.observations) {
    o.position = site.observations.front().position;
    o.has_heading = o.has_tilt = false;
  }
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  EXPECT_FALSE(geo.solved);
  EXPECT_NE(geo.reason.find("hardly differ, although the run moves"), std::string::npos) << geo.reason;
}

// Where positions show the turn much better than the headings disagree with it.
TEST(GeoRegistration, HeadingsFromMagneticNorthAreTold) {
  Site site = MakeSite(8, 0);
  for (const double off_deg : {10.0, -8.0}) {
    std::vector<GeoObservation> turned = site.observations;
    for (GeoObservation& o : turned) o.attitude.heading_rad += off_deg * kDegToRad;
    EXPECT_NE(OtherHeadings(turned).value_or("").find(off_deg > 0 ? "turned by +" : "turned by -"), std::string::npos)
        << OtherHeadings(turned).value_or("");
  }
  site.observations[2].attitude.heading_rad += 10 * kDegToRad;  // of one alone
  EXPECT_FALSE(OtherHeadings(site.observations));
}

TEST(GeoRegistration, TiltsThatScatterMoreThanStatedCountLess) {
  Site site = MakeSite(12, 0);
  Random random(5);
  for (GeoObservation& o : site.observations) {
    o.attitude.pitch_rad += 2.5 * o.sigma_tilt_rad * random.Normal();
    o.attitude.roll_rad += 2.5 * o.sigma_tilt_rad * random.Normal();
  }
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_NE(geo.reason.find("times their sigmas; as the error may be common to all, they count as one"),
            std::string::npos)
      << geo.reason;
  ExpectWithin(3, geo, site);
}

// All pitches and rolls by one instrument that is not level.
TEST(GeoRegistration, TiltsThatAreAllOffWidenTheTilt) {
  Site site = MakeSite(6, 0);
  const Eigen::Quaterniond tilt = ExpSO3({4 * kDegToRad, 0, 0});
  for (size_t i = 0; i < site.observations.size(); ++i) {
    GeoObservation& o = site.observations[i];
    o.attitude = AttitudeOf(tilt * WorldFromCamRotation(o.attitude));
    const double height = 0.2 * static_cast<double>(i);
    o.position.z() = height + 0.4 * (o.position.z() - height);  // heights of 0.2 m instead of 0.5 m
    o.sigma_v_m = 0.2;
  }
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_NE(geo.reason.find("pitch and roll and positions of the geotags contradict each other"), std::string::npos)
      << geo.reason;
  ExpectWithin(3, geo, site);
}

TEST(GeoRegistration, OneHeadingThatMayBeInRadiansDecidesNothing) {
  Few one = FirstOf(MakeSite(8, 0), 1);
  one.observations[0].attitude.heading_rad = 1.234 * kDegToRad;
  EXPECT_FALSE(one.Fit().solved);
  EXPECT_NE(one.Fit().reason.find("or write 361.234"), std::string::npos) << one.Fit().reason;
  for (const double deg : {361.234, 1.0, 0.0, 7.5}) {
    one.observations[0].attitude.heading_rad = deg * kDegToRad;
    EXPECT_TRUE(one.Fit().solved) << deg << one.Fit().reason;
  }
}

TEST(GeoRegistration, WhatDoesNotFixTheDirectionIsCounted) {
  Few few = FirstOf(MakeSite(8, 0), 1);
  few.observations[0].has_heading = false;
  EXPECT_NE(few.Fit().reason.find("1 position is there"), std::string::npos) << few.Fit().reason;
  EXPECT_NE(few.Fit().reason.find("expected positions more than"), std::string::npos) << few.Fit().reason;
  few.observations[0].has_position = false;
  few.observations[0].has_heading = true;
  EXPECT_NE(few.Fit().reason.find("none of 1 localized panoramas or photos has a position"), std::string::npos)
      << few.Fit().reason;
}

TEST(GeoRegistration, HeadingsOfThreeThatContradictTheirPositionsAreWithheld) {
  for (const int count : {2, 3}) {
    for (const bool radians : {true, false}) {
      Few few = FirstOf(MakeSite(9, 0), count);
      for (GeoObservation& o : few.observations) {
        o.attitude.heading_rad *= radians ? kDegToRad : -1;
        o.attitude.heading_rad += radians ? 0 : 1.9;  // counter-clockwise, and not by chance right at north
        o.has_tilt = false;
      }
      const GeoRegistration geo = few.Fit();
      EXPECT_FALSE(geo.solved) << count << radians;
      EXPECT_FALSE(geo.reason.empty());
    }
  }
  const GeoRegistration right = FirstOf(MakeSite(9, 0), 3).Fit();
  EXPECT_TRUE(right.solved) << right.reason;
}

// The site with places whose unit is `metres` long.
Site InUnit(Site site, double metres) {
  for (GeoObservation& o : site.observations) o.odom_from_rig.translation /= metres;
  for (Eigen::Index k = 0; k < site.odom_covariance.rows(); k += 6) {
    site.odom_covariance.block<3, 3>(k + 3, k + 3) /= metres * metres;
  }
  site.world_from_odom.scale *= metres;
  return site;
}

TEST(GeoRegistration, AnotherUnitIsNamedAndWithheld) {
  const std::vector<std::pair<std::string, double>> units = {
      {"feet", 0.3048}, {"centimetres", 0.01}, {"inches", 0.0254}};
  for (const auto& [name, metres] : units) {
    for (const int count : {3, 4, 8}) {
      Few few = FirstOf(InUnit(MakeSite(12, 0), metres), count);
      const GeoRegistration geo = few.Fit();
      EXPECT_FALSE(geo.solved) << name << count;
      EXPECT_NE(geo.reason.find(name), std::string::npos) << geo.reason;
    }
  }
  EXPECT_TRUE(FirstOf(MakeSite(12, 0), 3).Fit().solved);
}

TEST(GeoRegistration, AScaleThatIsOffIsMeasuredAndTold) {
  for (uint64_t seed = 20; seed < 40; ++seed) {
    const Site site = InUnit(MakeSite(seed, 0), 1.09);
    const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
    ASSERT_TRUE(geo.solved) << geo.reason;
    EXPECT_NE(geo.reason.find("the scale is taken from the geotags"), std::string::npos) << geo.reason;
    EXPECT_LT(std::abs(geo.world_from_odom.scale - site.world_from_odom.scale), 0.03);
    EXPECT_NEAR(std::sqrt(geo.covariance(6, 6)), 0.5 * std::abs(geo.world_from_odom.scale - 1), 0.01);
    EXPECT_LT(HorizontalError(geo, site, site.observations[0]), 0.6);
  }
}

// A run of images alone has any length: a drone's ground is hundreds of metres away.
TEST(GeoRegistration, ALengthThatNobodyTellsMayBeFarFromAMetre) {
  for (const double unit : {0.04, 30.0}) {
    const Site site = InUnit(MakeSite(20, 0), unit);
    const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 10, false, {});
    ASSERT_TRUE(geo.solved) << unit << ": " << geo.reason;
    ExpectWithin(4, geo, site);
    EXPECT_FALSE(RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {}).solved) << unit;
  }
}

// A scale stated as if it were exact, and 2.5 % off: geotags that contradict it are heard.
TEST(GeoRegistration, NoScaleIsExactWhereGeotagsContradictIt) {
  int contradicted = 0;
  double squares = 0;
  for (uint64_t seed = 20; seed < 40; ++seed) {
    const Site site = InUnit(MakeSite(seed, 0), 1.025);
    const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, kScale, 1e-6, false, {});
    ASSERT_TRUE(geo.solved) << geo.reason;
    if (geo.covariance(6, 6) < 1e-8) continue;  // by chance they do not contradict it
    ++contradicted;
    squares += std::pow(geo.world_from_odom.scale - site.world_from_odom.scale, 2) / geo.covariance(6, 6);
  }
  EXPECT_GT(contradicted, 10);
  EXPECT_LT(squares / contradicted, 4) << "mean square of the scale's error in its sigmas";
}

TEST(GeoRegistration, SigmasThatAreTooSmallAreSaidAndMadeLarger) {
  Site site = MakeSite(11, 0);
  for (GeoObservation& o : site.observations) o.has_heading = o.has_tilt = false;
  const double honest =
      std::sqrt(RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {}).covariance(3, 3));
  Random random(12);
  for (GeoObservation& o : site.observations) {
    o.position += Eigen::Vector3d(1.2 * random.Normal(), 1.2 * random.Normal(), 2 * random.Normal());
  }
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_NE(geo.reason.find("geotags (or GPS fixes) are farther off than their sigmas allow"), std::string::npos);
  EXPECT_GT(std::sqrt(geo.covariance(3, 3)), 1.5 * honest);
  ExpectWithin(3, geo, site);
}

// Variances in place of sigmas: 0.09 m for 0.3 m. Few of the positions are outliers by themselves.
TEST(GeoRegistration, SigmasThatAreAThirdAreMadeLargerByTheMedian) {
  constexpr int kDraws = 100;
  int enlarged_wrongly = 0, enlarged = 0, outside = 0;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    Site site = MakeSite(seed, 0);
    const auto fit = [&] { return RegisterToEarth(site.observations, site.odom_covariance, kScale, 0.001, false, {}); };
    const auto is_enlarged = [](const GeoRegistration& geo) {
      return geo.reason.find("geotags (or GPS fixes) are farther off than their sigmas allow") != std::string::npos;
    };
    enlarged_wrongly += is_enlarged(fit()) ? 1 : 0;
    for (GeoObservation& o : site.observations) o.sigma_h_m = 0.09, o.sigma_v_m = 0.25;
    const GeoRegistration geo = fit();
    enlarged += !geo.solved || is_enlarged(geo) ? 1 : 0;
    if (!geo.solved) continue;
    const Eigen::Vector3d error = ErrorOf(geo, site.world_from_odom).segment<3>(3);
    for (int k = 0; k < 3; ++k) outside += std::abs(error(k)) > 3 * std::sqrt(geo.covariance(3 + k, 3 + k)) ? 1 : 0;
  }
  EXPECT_LE(enlarged_wrongly, 1);
  EXPECT_GT(enlarged, kDraws / 2);
  EXPECT_LE(outside, 10);  // of 300
}

// A run that may be metres off as a whole, along all axes.
Few ShiftedRun(uint64_t seed) {
  constexpr int kPlaces = 15;
  constexpr double kShift_m = 2, kSigma_m = 0.3;
  Random random(seed);
  const auto normal3 = [&] { return Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()); };
  const Eigen::Vector3d shift_m = kShift_m * normal3();
  Eigen::MatrixXd shifted = Eigen::MatrixXd::Zero(6 * kPlaces, 3);
  Few path;
  for (int i = 0; i < kPlaces; ++i) {
    shifted.block<3, 3>(6 * i + 3, 0) = kShift_m * Eigen::Matrix3d::Identity();
    GeoObservation o;
    const Eigen::Vector3d at(10.0 * i, 0, 0);
    o.odom_from_rig.translation = at + shift_m;
    o.position = at + kSigma_m * normal3();
    o.sigma_h_m = o.sigma_v_m = kSigma_m;
    path.observations.push_back(o);
  }
  path.covariance = shifted * shifted.transpose() + 1e-6 * Eigen::MatrixXd::Identity(6 * kPlaces, 6 * kPlaces);
  return path;
}

// No single position contradicts the run, which may be metres off; neighbours, which it moves alike, do.
TEST(GeoRegistration, SigmasThatAreAThirdAreSeenThroughTheRunsOwnErrors) {
  constexpr int kDraws = 40;
  int wrongly = 0, found = 0, outliers = 0;
  std::vector<double> growths;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    Few path = ShiftedRun(seed);
    const auto is_doubted = [](const GeoRegistration& geo) {
      return !geo.solved ||
             geo.reason.find("geotags (or GPS fixes) are farther off than their sigmas allow") != std::string::npos;
    };
    const GeoRegistration honest = path.Fit();
    wrongly += is_doubted(honest) ? 1 : 0;
    for (GeoObservation& o : path.observations) o.sigma_h_m /= 3, o.sigma_v_m /= 3;
    const GeoRegistration geo = path.Fit();
    found += is_doubted(geo) ? 1 : 0;
    for (const bool outlier : geo.outlier) outliers += outlier ? 1 : 0;
    growths.push_back(geo.covariance(4, 4) / honest.covariance(4, 4));
  }
  EXPECT_LE(wrongly, 1);
  EXPECT_GT(found, kDraws - 3);
  EXPECT_LT(outliers, kDraws / 4);  // none by itself
  // The run's own uncertainty was right, and stays.
  EXPECT_LT(Median(growths), 1.5);
}

// One of 15 is three metres off, in a run that may be: that is no reason to doubt the others.
TEST(GeoRegistration, OneGrossErrorThatTheRunHidesEnlargesNothing) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Few path = ShiftedRun(seed);
    path.observations[5].position.y() += 3;
    const GeoRegistration geo = path.Fit();
    ASSERT_TRUE(geo.solved) << geo.reason;
    EXPECT_EQ(geo.reason.find("geotags are farther off"), std::string::npos) << seed << " " << geo.reason;
  }
}

// Places of a path of which each is that of the next: the errors follow each other.
TEST(GeoRegistration, ErrorsThatFollowEachOtherAreNoNoise) {
  Few path;
  constexpr int kPlaces = 12;
  const auto at = [](double s) { return Eigen::Vector3d(8 * s, 0.12 * s * s * s, 0); };
  for (int i = 0; i < kPlaces; ++i) {
    GeoObservation o;
    o.odom_from_rig = Rigid3d(Eigen::Quaterniond::Identity(), at(i));
    o.position = at(i + 1) + Eigen::Vector3d(0.1 * (i % 2), 0, 0);
    o.sigma_h_m = 0.3, o.sigma_v_m = 0.5;
    path.observations.push_back(o);
  }
  path.covariance = 1e-4 * Eigen::MatrixXd::Identity(6 * kPlaces, 6 * kPlaces);
  const GeoRegistration geo = path.Fit();
  EXPECT_FALSE(geo.solved) << geo.reason;
}

// Mean NEES of a degree of freedom over redraws of geotags, places and scale.
double MeanNees(double loss_chi2, int redraws) {
  GeoRegistrationOptions options;
  options.loss_chi2 = loss_chi2;
  double sum = 0;
  for (int k = 0; k < redraws; ++k) {
    const Site site = MakeSite(static_cast<uint64_t>(k) + 50, 0);
    const double said = kScale + 0.01 * Random(static_cast<uint64_t>(k) + 100'000).Normal();
    const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, said, 0.01, false, options);
    EXPECT_TRUE(geo.solved) << geo.reason;
    const Eigen::Matrix<double, 7, 1> e = ErrorOf(geo, site.world_from_odom);
    sum += e.dot(geo.covariance.ldlt().solve(e)) / (7 * redraws);
  }
  return sum;
}

TEST(GeoRegistration, CovarianceIsThatOfRedraws) {
  constexpr int kRedraws = 2000;
  const double band = 2.6 * std::sqrt(2 / (7.0 * kRedraws));  // 99 %
  // One draw in twenty contradicts odometry's scale by chance. The variances of scale and turn, two degrees of freedom
  // of seven, grow there by 4 and more, so that about 0.7 of their NEES is missing. As often, positions contradict the
  // turn in plan by attitudes, and the tilt: one degree of freedom each, of which nearly all is missing, as attitudes
  // hold both far better than positions. (0.966 +- 0.005 over 12,000 redraws.)
  constexpr double kExpected = 1 - (0.05 * 0.7 * 2 + 0.05 * 2) / 7;
  // With a kernel that lets all normal errors pass, so that the estimate is the linear one; and with the robust one.
  EXPECT_NEAR(MeanNees(1e4, kRedraws), kExpected, band);
  EXPECT_NEAR(MeanNees(GeoRegistrationOptions().loss_chi2, kRedraws), kExpected, band);
}

TEST(GeoRegistration, ARunThatIsNotLevelIsNotTakenAsLevel) {
  Site site = MakeSite(5, 0);  // its frame is tilted by 0.022 rad
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, true, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_NE(geo.reason.find("tilted by 1."), std::string::npos) << geo.reason;
  const Eigen::Matrix<double, 7, 1> e = ErrorOf(geo, site.world_from_odom);
  for (int k = 0; k < 7; ++k) EXPECT_LT(std::abs(e(k)), 4 * std::sqrt(geo.covariance(k, k))) << k;
  // One that is level is taken as level, without a word.
  for (GeoObservation& o : site.observations) {
    o.odom_from_rig.rotation = ExpSO3({0.01, -0.02, 1.1}) * o.odom_from_rig.rotation;
    o.odom_from_rig.translation = ExpSO3({0.01, -0.02, 1.1}) * o.odom_from_rig.translation;
  }
  const GeoRegistration level = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, true, {});
  EXPECT_TRUE(level.solved);
  EXPECT_EQ(level.reason, "");
}

TEST(GeoRegistration, AHeightThatNobodyTellsIsAssumedAndUnknown) {
  Site site = MakeSite(3, 0);
  for (GeoObservation& o : site.observations) o.has_height = false, o.position.z() = 100;
  const GeoRegistration geo = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_NEAR(std::sqrt(geo.covariance(5, 5)), kUnknownHeightSigma, 0.01 * kUnknownHeightSigma);
  double mean = 0;
  for (const GeoObservation& o : site.observations) mean += (geo.world_from_odom * o.odom_from_rig.translation).z() / 8;
  EXPECT_NEAR(mean, 100, 1);
  for (const Eigen::Vector3d& r : geo.residuals) EXPECT_EQ(r.z(), 0) << "there is no height to differ from";
  const Eigen::Matrix<double, 7, 1> e = ErrorOf(geo, site.world_from_odom);
  for (const int k : {0, 1, 2, 3, 4, 6}) EXPECT_LT(std::abs(e(k)), 5 * std::sqrt(geo.covariance(k, k))) << k;
  // One height is enough.
  site.observations[2].has_height = true;
  const GeoRegistration one = RegisterToEarth(site.observations, site.odom_covariance, 1, 0.01, false, {});
  ASSERT_TRUE(one.solved) << one.reason;
  EXPECT_LT(std::sqrt(one.covariance(5, 5)), 1);
}

// Where the sea lies is known to 50 m, but is the same for all: the tilt follows from the heights' own noise, which
// also shows the one that is wrong.
TEST(GeoRegistration, HeightsAboveTheSeaShareOneError) {
  constexpr int kDraws = 60, kPlaces = 20, kWrong = 4;
  constexpr double kSea_m = 50, kOwn_m = 2;
  const Eigen::MatrixXd known = 1e-4 * Eigen::MatrixXd::Identity(6 * kPlaces, 6 * kPlaces);
  const GeoRegistrationOptions options;
  double nees = 0;
  for (uint64_t draw = 0; draw < kDraws; ++draw) {
    Random random(draw);
    const double tilt = options.tilt_sigma_deg * kDegToRad;
    const Sim3d truth = {1 + 0.01 * random.Normal(),
                         ExpSO3({tilt * random.Normal(), tilt * random.Normal(), 0}) * ExpSO3({0, 0, 0.7}),
                         Eigen::Vector3d(4, -7, 0)};
    const double sea = kSea_m * random.Normal();
    std::vector<GeoObservation> observations;
    for (int i = 0; i < kPlaces; ++i) {
      GeoObservation o;
      const Eigen::Vector3d at(10.0 * (i % 5), 15.0 * (i / 5), 3 * std::sin(i));
      o.odom_from_rig.translation =
          truth.Inverse() * at + 0.01 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
      o.position = at + Eigen::Vector3d(random.Normal(), random.Normal(), sea + kOwn_m * random.Normal());
      o.sigma_h_m = 1, o.sigma_v_m = kOwn_m, o.sigma_sea_m = kSea_m;
      if (i == kWrong) o.position.z() += 40;
      observations.push_back(o);
    }
    const GeoRegistration geo = RegisterToEarth(observations, known, 1, 0.01, false, options);
    ASSERT_TRUE(geo.solved) << geo.reason;
    EXPECT_TRUE(geo.outlier[kWrong]);
    EXPECT_NEAR(std::sqrt(geo.covariance(5, 5)), kSea_m, 0.02 * kSea_m);
    EXPECT_LT(std::sqrt(geo.covariance(0, 0)), 2 * kDegToRad);
    const Eigen::Matrix<double, 7, 1> e = ErrorOf(geo, truth);
    nees += e.dot(geo.covariance.ldlt().solve(e)) / (7 * kDraws);
  }
  EXPECT_NEAR(nees, 1, 3 * std::sqrt(2.0 / (7 * kDraws)));
}

// Places within two metres of each other, each known to five: any direction fits.
TEST(GeoRegistration, PositionsThatShowNoDirectionAreSaidToShowNone) {
  constexpr int kPlaces = 19;
  Random random(4);
  std::vector<GeoObservation> observations;
  for (int i = 0; i < kPlaces; ++i) {
    GeoObservation o;
    const Eigen::Vector3d at(2 * std::cos(0.3 * i), 2 * std::sin(0.3 * i), 0);
    o.odom_from_rig.translation = at;
    o.position = at + 5 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    o.sigma_h_m = o.sigma_v_m = 5;
    observations.push_back(o);
  }
  const Eigen::MatrixXd known = 1e-4 * Eigen::MatrixXd::Identity(6 * kPlaces, 6 * kPlaces);
  const GeoRegistration geo = RegisterToEarth(observations, known, 1, 0.01, false, {});
  EXPECT_FALSE(geo.solved);
  EXPECT_NE(geo.reason.find("lie too near each other"), std::string::npos) << geo.reason;
}

TEST(GeoRegistration, ManyPositionsWithoutHeadingGiveTheDirection) {
  Site site = MakeSite(2, 0);
  constexpr int kFixes = 301;
  std::vector<GeoObservation> fixes;
  for (int i = 0; i < kFixes; ++i) {
    GeoObservation o = site.observations[0];
    o.has_heading = o.has_tilt = false;
    const double a = 2 * EIGEN_PI * i / kFixes;
    o.position = Eigen::Vector3d(15 * std::cos(a), 10 * std::sin(a), 1);
    o.odom_from_rig.translation = site.world_from_odom.Inverse() * o.position;
    fixes.push_back(o);
  }
  const Eigen::MatrixXd covariance = 1e-4 * Eigen::MatrixXd::Identity(6 * kFixes, 6 * kFixes);
  const GeoRegistration geo = RegisterToEarth(fixes, covariance, 1, 0.01, false, {});
  ASSERT_TRUE(geo.solved) << geo.reason;
  EXPECT_LT(LogSO3(geo.world_from_odom.rotation * site.world_from_odom.rotation.conjugate()).norm(), 0.05);
}

TEST(GeoRegistration, SaysWhyNot) {
  const GeoRegistration none = RegisterToEarth({}, Eigen::MatrixXd(), 1, 0.01, false, {});
  EXPECT_FALSE(none.solved);
  EXPECT_FALSE(none.reason.empty());
  // One position without an attitude: nothing tells where north is.
  Site site = MakeSite(2, 0);
  GeoObservation o = site.observations[0];
  o.has_heading = o.has_tilt = false;
  const GeoRegistration one = RegisterToEarth({o}, site.odom_covariance.topLeftCorner(6, 6), 1, 0.01, false, {});
  EXPECT_FALSE(one.solved);
  EXPECT_FALSE(one.reason.empty());
}

}  // namespace
}  // namespace trigpoint
