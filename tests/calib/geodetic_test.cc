#include "calib/geo/geodetic.h"

#include <gtest/gtest.h>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/UTMUPS.hpp>
#include <limits>
#include <numbers>

#include "calib/base/error.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

const Geodetic kPlaces[] = {{48.0125518, 7.8322567, 240}, {0, 0, 0},     {-33.86, 151.21, 25},
                            {64.15, -21.94, -40},         {89.9, 30, 0}, {-54.8, -68.3, 8000}};

double MetresApart(const Geodetic& a, const Geodetic& b) { return (EcefFromGeodetic(a) - EcefFromGeodetic(b)).norm(); }

TEST(Geodetic, EcefByTheTextbook) {
  // WGS 84 by hand: N = a / sqrt(1 - e^2 sin^2), X = (N + h) cos cos, Z = (N (1 - e^2) + h) sin.
  const double a = 6378137, f = 1 / 298.257223563, e2 = f * (2 - f);
  for (const Geodetic& g : kPlaces) {
    const double lat = g.latitude_deg * kDegToRad, lon = g.longitude_deg * kDegToRad;
    const double n = a / std::sqrt(1 - e2 * std::sin(lat) * std::sin(lat));
    const Eigen::Vector3d expected((n + g.height_m) * std::cos(lat) * std::cos(lon),
                                   (n + g.height_m) * std::cos(lat) * std::sin(lon),
                                   (n * (1 - e2) + g.height_m) * std::sin(lat));
    EXPECT_LT((EcefFromGeodetic(g) - expected).norm(), 1e-8);
    EXPECT_LT(MetresApart(GeodeticFromEcef(expected), g), 1e-8);
  }
}

TEST(Geodetic, LocalFrameAgreesWithGeographicLibAndGoesThereAndBack) {
  Random random(1);
  for (const Geodetic& origin : kPlaces) {
    const LocalFrame frame(origin);
    const GeographicLib::LocalCartesian reference(origin.latitude_deg, origin.longitude_deg, origin.height_m);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d enu = 500 * RandomNormal3(random);
      const Geodetic g = frame.GeodeticFromEnu(enu);
      EXPECT_LT((frame.EnuFromGeodetic(g) - enu).norm(), 2e-8);
      Eigen::Vector3d expected;
      reference.Forward(g.latitude_deg, g.longitude_deg, g.height_m, expected.x(), expected.y(), expected.z());
      EXPECT_LT((enu - expected).norm(), 2e-8);
      EXPECT_LT((frame.EcefFromEnuRotation() * enu + EcefFromGeodetic(origin) - EcefFromGeodetic(g)).norm(), 2e-8);
    }
  }
}

TEST(Geodetic, AxesAreEastNorthUp) {
  for (const Geodetic& origin : kPlaces) {
    const LocalFrame frame(origin);
    const auto azimuth = [&](const Eigen::Vector3d& enu) {
      const Geodetic g = frame.GeodeticFromEnu(enu);
      double azi = 0, back = 0;
      GeographicLib::Geodesic::WGS84().Inverse(origin.latitude_deg, origin.longitude_deg, g.latitude_deg,
                                               g.longitude_deg, azi, back);
      return azi;
    };
    EXPECT_NEAR(azimuth({0, 100, 0}), 0, 1e-6);
    EXPECT_NEAR(azimuth({100, 0, 0}), 90, 1e-3);
    EXPECT_NEAR(frame.GeodeticFromEnu({0, 0, 12}).height_m, origin.height_m + 12, 1e-8);
    EXPECT_NEAR(frame.EcefFromEnuRotation().determinant(), 1, 1e-14);
  }
}

TEST(Geodetic, RefusesWhatIsNotOnTheEarth) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(LocalFrame({91, 0, 0}), InputError);
  EXPECT_THROW(LocalFrame({0, 541, 0}), InputError);
  EXPECT_THROW(LocalFrame({nan, 0, 0}), InputError);
  EXPECT_THROW(EcefFromGeodetic({0, 0, nan}), InputError);
  EXPECT_NO_THROW(LocalFrame({90, 180, 0}));
}

TEST(Utm, AgreesWithGeographicLibAndGoesThereAndBack) {
  for (const Geodetic& g : kPlaces) {
    if (g.latitude_deg > 84) continue;
    const Utm utm = UtmFromGeodetic(g);
    int zone = 0;
    bool north = false;
    double x = 0, y = 0;
    GeographicLib::UTMUPS::Forward(g.latitude_deg, g.longitude_deg, zone, north, x, y);
    EXPECT_EQ(utm.zone, zone);
    EXPECT_EQ(utm.north, north);
    EXPECT_EQ(utm.easting_m, x);
    EXPECT_EQ(utm.northing_m, y);
    EXPECT_LT(MetresApart(GeodeticFromUtm(utm, g.height_m), g), 1e-7);
  }
}

TEST(Utm, HasTheCodesAndTheFalseOrigins) {
  // On the central meridian of zone 32 (9 deg east) at the equator: easting 500 km, northing 0.
  const Utm centre = UtmFromGeodetic({0, 9, 0});
  EXPECT_EQ(centre.zone, 32);
  EXPECT_EQ(centre.EpsgCode(), 32632);
  EXPECT_NEAR(centre.easting_m, 500000, 1e-6);
  EXPECT_NEAR(centre.northing_m, 0, 1e-6);
  const Utm south = UtmFromGeodetic({-33.86, 151.21, 0});
  EXPECT_EQ(south.EpsgCode(), 32756);
  EXPECT_GT(south.northing_m, 5e6);
  // A neighbouring zone on request.
  const Utm forced = UtmFromGeodetic({48, 11.5, 0}, 33);
  EXPECT_EQ(forced.zone, 33);
  EXPECT_LT(MetresApart(GeodeticFromUtm(forced, 0), {48, 11.5, 0}), 1e-6);
  EXPECT_THROW(GeodeticFromUtm({32, true, 9e6, 1e8}, 0), InputError);
}

TEST(Attitude, CompassDirections) {
  const Eigen::Vector3d right(1, 0, 0), down(0, 1, 0), forward(0, 0, 1);
  const auto expect = [](const Eigen::Vector3d& found, const Eigen::Vector3d& wanted) {
    EXPECT_LT((found - wanted).norm(), 1e-12) << found.transpose();
  };
  const double quarter = std::numbers::pi / 2;
  expect(WorldFromCamRotation({0, 0, 0}) * forward, {0, 1, 0});        // north
  expect(WorldFromCamRotation({quarter, 0, 0}) * forward, {1, 0, 0});  // 90 deg is east
  expect(WorldFromCamRotation({quarter, 0, 0}) * right, {0, -1, 0});
  expect(WorldFromCamRotation({0.3, 0, 0}) * down, {0, 0, -1});
  expect(WorldFromCamRotation({0, 0.1, 0}) * forward, {0, std::cos(0.1), std::sin(0.1)});  // pitch raises the axis
  expect(WorldFromCamRotation({0, 0, 0.1}) * right, {std::cos(0.1), 0, -std::sin(0.1)});   // roll: right side sinks
}

TEST(Attitude, GoesThereAndBack) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Attitude a{random.Uniform(0, 2 * std::numbers::pi), random.Uniform(-1.5, 1.5), random.Uniform(-3.1, 3.1)};
    const Attitude b = AttitudeOf(WorldFromCamRotation(a));
    EXPECT_NEAR(WrapAngle(a.heading_rad - b.heading_rad), 0, 1e-12);
    EXPECT_NEAR(a.pitch_rad, b.pitch_rad, 1e-12);
    EXPECT_NEAR(a.roll_rad, b.roll_rad, 1e-11);
    EXPECT_GE(b.heading_rad, 0);
    EXPECT_LT(b.heading_rad, 2 * std::numbers::pi);
    const Eigen::Quaterniond q = RandomRotation(random);
    EXPECT_LT(AngleBetween(WorldFromCamRotation(AttitudeOf(q)), q), 1e-12);
  }
  for (const double sign : {-1.0, 1.0}) {  // straight up and down
    const Eigen::Quaterniond q = WorldFromCamRotation({1.2, sign * std::numbers::pi / 2, 0});
    EXPECT_LT(AngleBetween(WorldFromCamRotation(AttitudeOf(q)), q), 1e-9);
    EXPECT_EQ(AttitudeOf(q).roll_rad, 0);
  }
}

TEST(Attitude, JacobianIsTheDerivative) {
  Random random(4);
  for (int i = 0; i < 50; ++i) {
    const Attitude a{random.Uniform(0.1, 6.1), random.Uniform(-1.3, 1.3), random.Uniform(-3, 3)};
    const Eigen::Quaterniond q = WorldFromCamRotation(a);
    const Eigen::MatrixXd numeric = NumericJacobian(
        [&](const Eigen::VectorXd& w) {
          const Attitude b = AttitudeOf(ExpSO3(Eigen::Vector3d(w)) * q);
          return Eigen::Vector3d(b.heading_rad, b.pitch_rad, b.roll_rad);
        },
        Eigen::Vector3d::Zero());
    EXPECT_LT((AttitudeJacobian(q) - numeric).cwiseAbs().maxCoeff(), 1e-7);
  }
  EXPECT_THROW(AttitudeJacobian(WorldFromCamRotation({0.4, std::numbers::pi / 2, 0})), NumericError);
}

TEST(Attitude, CovarianceIsTheScatterOfRotations) {
  Random random(5);
  const Attitude a{2.3, 0.4, -0.3};
  const double sh = 0.017, sp = 0.005, sr = 0.008;
  const Eigen::Matrix3d predicted = AttitudeCovariance(a, sh, sp, sr);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  const int n = 50000;
  for (int i = 0; i < n; ++i) {
    const double h = sh * random.Normal(), p = sp * random.Normal(), r = sr * random.Normal();
    const Eigen::Quaterniond q = WorldFromCamRotation({a.heading_rad + h, a.pitch_rad + p, a.roll_rad + r});
    const Eigen::Vector3d w = LogSO3(q * WorldFromCamRotation(a).conjugate());
    scatter += w * w.transpose() / n;
  }
  EXPECT_LT(CovarianceDeviation(scatter, predicted), 0.03);
  // And back: the sigmas of the angles that the Jacobian makes of it.
  const Eigen::Matrix3d j = AttitudeJacobian(WorldFromCamRotation(a));
  const Eigen::Vector3d sigmas = (j * predicted * j.transpose()).diagonal().cwiseSqrt();
  EXPECT_LT((sigmas - Eigen::Vector3d(sh, sp, sr)).norm(), 1e-12);
}

TEST(Angles, Wrap) {
  const double pi = std::numbers::pi;
  EXPECT_NEAR(WrapAngle(3 * pi), pi, 1e-12);
  EXPECT_NEAR(WrapAngle(-pi), pi, 1e-12);
  EXPECT_NEAR(WrapAngle(2 * pi + 0.1), 0.1, 1e-12);
  EXPECT_NEAR(WrapAngle(-0.1), -0.1, 1e-15);
}

}  // namespace
}  // namespace trigpoint
