// Readings of a total station: derivatives, recovery of a network, covariance by redraws, blunders by name.
#include "survey/tags/total_station.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <map>

#include "calib/base/error.h"
#include "calib/estimation/manifold.h"
#include "calib/estimation/random.h"
#include "calib/geo/geodetic.h"
#include "tests/support/temp_dir.h"
#include "tests/survey/gradients.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr StationReading kReadings[] = {StationReading::kDirection, StationReading::kZenith, StationReading::kDistance};

// Predicted readings of the costs' own model, for made-up observations: residual 0 at the truth.
double Read(StationReading reading, const Eigen::Vector3d& instrument, const Eigen::Vector3d& target, double height,
            double orientation) {
  const StationCost cost(reading, 0, 1, {}, height);
  const double* parameters[] = {instrument.data(), target.data(), &orientation};
  double value = 0;
  EXPECT_TRUE(cost.Evaluate(parameters, &value, nullptr));
  return value;
}

TEST(StationCost, Derivatives) {
  Random random(3);
  const Rigid3Manifold manifold;
  for (int draw = 0; draw < 20; ++draw) {
    Eigen::Vector3d instrument(100 * random.Normal(), 100 * random.Normal(), 2 * random.Normal());
    Eigen::Vector3d target =
        instrument + Eigen::Vector3d(20 + 5 * random.Normal(), 20 * random.Normal(), 3 * random.Normal());
    double orientation = random.Uniform(-3, 3);
    // At identity, near pi, tiny and anyhow.
    const double angle = draw == 0 ? 0 : draw == 1 ? 3.14159 : draw == 2 ? 1e-8 : random.Uniform(0, 3);
    const Rigid3d tag(ExpSO3(angle * Eigen::Vector3d(1, 2, 3).normalized()), target);
    std::array<double, 7> block{};
    Rigid3ToBlock(tag, block.data());
    const Rigid3d level = draw % 2 == 0
                              ? Rigid3d()
                              : Rigid3d(ExpSO3({0.05 * random.Normal(), 0.05 * random.Normal(), 0.3}), {30, -20, 5});
    for (StationReading reading : kReadings) {
      for (const bool on_tag : {false, true}) {
        const StationCost cost(reading, 0.3, reading == StationReading::kDistance ? 0.002 : 2e-4,
                               on_tag ? std::optional<Eigen::Vector3d>({0.1, -0.2, 0.05}) : std::nullopt, 0.1, level);
        std::vector<const ceres::Manifold*> manifolds = {nullptr, on_tag ? &manifold : nullptr};
        std::vector<const double*> parameters = {instrument.data(), on_tag ? block.data() : target.data()};
        if (reading == StationReading::kDirection) manifolds.push_back(nullptr), parameters.push_back(&orientation);
        ceres::NumericDiffOptions options;
        options.ridders_relative_initial_step_size = 1e-4;
        ExpectDerivatives(cost, manifolds, parameters, options);
      }
    }
  }
}

// East of the instrument the circle reads 90 deg; a level sight to a point 1 km off at the same height above the
// Earth's sphere shows it lower by curvature less refraction.
TEST(StationCost, AnglesAreThoseOfAnInstrument) {
  const Eigen::Vector3d here(0, 0, 100), east(50, 0, 100), north(0, 50, 100), up(0, 50, 150);
  EXPECT_NEAR(Read(StationReading::kDirection, here, east, 0, 0), 90 * kDegToRad, 1e-9);
  EXPECT_NEAR(Read(StationReading::kDirection, here, north, 0, 0.1), -0.1, 1e-9);
  EXPECT_NEAR(Read(StationReading::kZenith, here, up, 0, 0), 45 * kDegToRad, 1e-6);
  EXPECT_NEAR(Read(StationReading::kDistance, here, up, 0, 0), 50 * std::sqrt(2), 1e-9);
  // 1 km away, as high above the sphere: 1000^2 / 2R = 0.0785 m below the plane; read 0.0785 (1 - 0.13) m below level.
  const Eigen::Vector3d far(0, 1000, 100 - 0.0785);
  EXPECT_NEAR((Read(StationReading::kZenith, here, far, 0, 0) - 90 * kDegToRad) * 1000, 0.0785 * 0.87, 2e-4);
}

constexpr double kAngle_rad = 2e-5, kLength_m = 0.002, kKnown_m = 0.003, kCentring_m = 0.001;

struct Site {
  std::map<std::string, Eigen::Vector3d> points;
  std::vector<NetworkPoint> known;
  std::vector<StationSighting> sightings;
};

// Two known pillars and a known church; one set-up over a pillar, one anywhere, one over the other pillar if asked for;
// tags round them.
Site MakeSite(uint64_t seed, bool three_setups = false) {
  Random random(seed);
  Site site;
  site.points = {{"A", {0, 0, 0}}, {"B", {80, 5, 1}}, {"church", {30, 150, 12}}, {"free", {40, 30, 0.5}}};
  for (int k = 0; k < 6; ++k) {
    const double a = 1.1 * k;
    site.points["tag:" + std::to_string(k)] = {40 + 25 * std::sin(a), 20 + 25 * std::cos(a), 1.5 + 0.2 * k};
  }
  for (const char* name : {"A", "B", "church"}) {
    const Eigen::Vector3d off(random.Normal(), random.Normal(), random.Normal());
    site.known.push_back({name, site.points.at(name) + kKnown_m * off, kKnown_m, kKnown_m});
  }
  int line = 1;
  std::vector<std::string> setups = {"A", "free"};
  if (three_setups) setups.push_back("B");
  for (const std::string& setup : setups) {
    const Eigen::Vector3d off(random.Normal(), random.Normal(), random.Normal());
    const Eigen::Vector3d instrument = site.points.at(setup) + Eigen::Vector3d(0, 0, 1.6) + kCentring_m * off;
    const double orientation = setup == "A" ? 2.9 : setup == "B" ? 0.4 : -1.2;
    for (const auto& [name, at] : site.points) {
      if (name == setup || name == "free") continue;
      StationSighting s;
      s.setup = setup, s.target = name;
      s.instrument_height_m = 1.6;
      s.target_height_m = name[0] == 't' ? 0 : 0.2;
      s.sigma_direction_rad = s.sigma_zenith_rad = kAngle_rad, s.sigma_distance_m = kLength_m;
      const auto read = [&](StationReading r) { return Read(r, instrument, at, s.target_height_m, orientation); };
      s.direction_rad = read(StationReading::kDirection) + kAngle_rad * random.Normal();
      s.zenith_rad = read(StationReading::kZenith) + kAngle_rad * random.Normal();
      if (name != "church") s.distance_m = read(StationReading::kDistance) + kLength_m * random.Normal();
      s.line = ++line;
      site.sightings.push_back(s);
    }
  }
  return site;
}

TEST(StationNetwork, IsAsGoodAsItSays) {
  constexpr int kDraws = 200;
  double nees = 0;
  Eigen::Index dof = 0;
  int excluded = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Site site = MakeSite(static_cast<uint64_t>(draw));
    const StationNetwork network = AdjustNetwork(site.sightings, site.known, {});
    EXPECT_TRUE(network.unplaced.empty());
    ASSERT_THAT(network.points, SizeIs(site.points.size()));
    dof = network.covariance.rows();
    Eigen::VectorXd e(dof);
    for (size_t k = 0; k < network.points.size(); ++k) {
      e.segment<3>(3 * static_cast<Eigen::Index>(k)) =
          network.points[k].position - site.points.at(network.points[k].name);
    }
    nees += e.dot(network.covariance.ldlt().solve(e)) / kDraws;
    for (const NetworkResidual& r : network.residuals) excluded += r.excluded;
  }
  // The mean of so many chi-squares. What is taken out by chance, 0.01 % of 44 readings, changes nothing.
  EXPECT_NEAR(nees, static_cast<double>(dof), 3 * std::sqrt(2.0 * static_cast<double>(dof) / kDraws));
  EXPECT_LE(excluded, 5);
}

// Readings do not depend on where world begins and how it is turned, and neither does what they show.
void ExpectTheSameNetwork(const StationNetwork& here, const StationNetwork& there, const Rigid3d& there_from_here) {
  EXPECT_EQ(here.warnings, there.warnings);
  ASSERT_THAT(there.points, SizeIs(here.points.size()));
  const Eigen::Matrix3d turn = there_from_here.rotation.toRotationMatrix();
  for (size_t k = 0; k < here.points.size(); ++k) {
    const auto at = 3 * static_cast<Eigen::Index>(k);
    EXPECT_LT((there.points[k].position - there_from_here * here.points[k].position).norm(), 1e-5)
        << here.points[k].name;
    const Eigen::Matrix3d one = here.covariance.block<3, 3>(at, at), two = there.covariance.block<3, 3>(at, at);
    EXPECT_LT((two - turn * one * turn.transpose()).norm(), 1e-4 * one.norm()) << here.points[k].name;
  }
  ASSERT_THAT(there.setups, SizeIs(here.setups.size()));
  for (size_t k = 0; k < here.setups.size(); ++k) {
    EXPECT_LT((there.setups[k].instrument - there_from_here * here.setups[k].instrument).norm(), 1e-5);
  }
}

std::vector<NetworkPoint> Moved(std::vector<NetworkPoint> points, const Rigid3d& there_from_here) {
  for (NetworkPoint& p : points) p.position = there_from_here * p.position;
  return points;
}

// A national grid begins far from the site: its numbers are no distances along which the vertical leans.
TEST(StationNetwork, CoordinatesOfTheSurveyorsOwnMayBeginAnywhere) {
  const Site site = MakeSite(11);
  const Rigid3d grid(Eigen::Quaterniond::Identity(), {512'000, 5'321'000, 310});
  const std::vector<NetworkPoint> far = Moved(site.known, grid);
  const auto adjusted = [&](const std::vector<NetworkPoint>& known) {
    return AdjustNetwork(site.sightings, known, {}, LevelFromWorld(known, site.sightings, std::nullopt));
  };
  const StationNetwork here = adjusted(site.known), there = adjusted(far);
  EXPECT_THAT(here.warnings, SizeIs(0));
  ExpectTheSameNetwork(here, there, grid);
}

// An ENU frame that begins 500 km away has z 4.5 deg off the site's vertical.
TEST(StationNetwork, AnOriginFarAwayTurnsTheVertical) {
  const Site site = MakeSite(12);
  const LocalFrame near({48, 7.8, 250}), far({52, 4.5, 0});
  const Rigid3d far_from_ecef =
      Rigid3d(Eigen::Quaterniond(far.EcefFromEnuRotation()), EcefFromGeodetic(far.origin())).Inverse();
  const Rigid3d far_from_near =
      far_from_ecef * Rigid3d(Eigen::Quaterniond(near.EcefFromEnuRotation()), EcefFromGeodetic(near.origin()));
  ASSERT_GT(far_from_near.translation.head<2>().norm(), 4e5);
  ASSERT_LT(
      (far_from_near * Eigen::Vector3d(10, 20, 3) - far.EnuFromGeodetic(near.GeodeticFromEnu({10, 20, 3}))).norm(),
      1e-6);
  const std::vector<NetworkPoint> known = Moved(site.known, far_from_near);
  const StationNetwork here =
      AdjustNetwork(site.sightings, site.known, {}, LevelFromWorld(site.known, site.sightings, near));
  const StationNetwork there = AdjustNetwork(site.sightings, known, {}, LevelFromWorld(known, site.sightings, far));
  EXPECT_THAT(here.warnings, SizeIs(0));
  ExpectTheSameNetwork(here, there, far_from_near);
}

// A tower 6 km away that orients the circle: were the frame level half way to it, the site's vertical would lean.
TEST(StationNetwork, TheVerticalIsThatOfTheSiteNotOfAFarTarget) {
  Site site = MakeSite(13);
  site.known.push_back({"tower", {3600, 4800, 90}, kKnown_m, kKnown_m});
  StationSighting s = site.sightings.front();
  s.target = "tower";
  s.distance_m.reset();
  site.sightings.push_back(s);
  // The instrument stands on A and measures the distance to B; church and tower are read for their angles alone.
  const Eigen::Vector3d middle = 0.5 * (site.known[0].position + site.known[1].position);
  EXPECT_LT((LevelFromWorld(site.known, site.sightings, std::nullopt) * middle).norm(), 1e-9);
  // Nothing is known to be near.
  for (StationSighting& each : site.sightings) each.setup = "free", each.distance_m.reset();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const NetworkPoint& p : site.known) sum += p.position;
  EXPECT_LT((LevelFromWorld(site.known, site.sightings, std::nullopt) * Eigen::Vector3d(sum / 4)).norm(), 1e-9);
}

TEST(StationNetwork, BlundersAreNamed) {
  Site site = MakeSite(7, true);
  StationSighting& wrong = site.sightings[5];
  *wrong.direction_rad += 0.05 * kDegToRad;
  StationSighting& other = site.sightings[12];
  *other.distance_m += 0.1;
  const StationNetwork network = AdjustNetwork(site.sightings, site.known, {});
  ASSERT_THAT(network.warnings, SizeIs(2));
  const std::string all = network.warnings[0] + network.warnings[1];
  EXPECT_THAT(all, HasSubstr("line " + std::to_string(wrong.line) + ": the direction from A to " + wrong.target));
  EXPECT_THAT(all,
              HasSubstr("line " + std::to_string(other.line) + ": the slope distance from free to " + other.target));
  for (const NetworkPoint& p : network.points) EXPECT_LT((p.position - site.points.at(p.name)).norm(), 0.02) << p.name;
}

// From two set-ups only the direction of one and the distance of the other hold tag 3 towards north: an error of either
// looks the same.
TEST(StationNetwork, ReadingsThatCannotBeToldApartAreNamedTogether) {
  Site site = MakeSite(7);
  StationSighting& wrong = site.sightings[5];
  ASSERT_EQ(wrong.target, "tag:3");
  *wrong.direction_rad += 0.05 * kDegToRad;
  const StationNetwork network = AdjustNetwork(site.sightings, site.known, {});
  ASSERT_THAT(network.warnings, SizeIs(1));
  EXPECT_THAT(network.warnings[0], HasSubstr("line " + std::to_string(wrong.line) + ": the direction from A to tag:3"));
  EXPECT_THAT(network.warnings[0], HasSubstr("the slope distance from free to tag:3"));
  EXPECT_THAT(network.warnings[0], HasSubstr("it could as well be"));
}

TEST(StationNetwork, WhatKnownPointsDoNotReachIsNamed) {
  Site site = MakeSite(8);
  StationSighting alone = site.sightings.front();
  alone.setup = "lost", alone.target = "tag:99";
  site.sightings.push_back(alone);
  EXPECT_THAT(AdjustNetwork(site.sightings, site.known, {}).unplaced, testing::ElementsAre("lost", "tag:99"));
  EXPECT_THROW(AdjustNetwork(site.sightings, {}, {}), InputError);
}

TEST(StationNetwork, AHeightIsThatOfItsWholeSetup) {
  Site site = MakeSite(4);
  const StationNetwork all = AdjustNetwork(site.sightings, site.known, {});
  std::string last;
  for (StationSighting& s : site.sightings) {
    if (s.setup == last) s.instrument_height_m = 0;  // only the first row states it
    last = s.setup;
  }
  const StationNetwork once = AdjustNetwork(site.sightings, site.known, {});
  ASSERT_EQ(all.points.size(), once.points.size());
  for (size_t k = 0; k < all.points.size(); ++k) EXPECT_EQ(all.points[k].position, once.points[k].position);
  site.sightings[1].instrument_height_m = 1.7;
  EXPECT_THAT(MessageOf<InputError>([&] { AdjustNetwork(site.sightings, site.known, {}); }),
              testing::HasSubstr("set-up A has instrument heights of 1.6 m and 1.7 m"));
}

}  // namespace
}  // namespace trigpoint
