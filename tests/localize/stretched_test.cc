// Panoramas whose pictures are stretched in height.
#include "localize/references/stretched.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/estimation/random.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {
namespace {

constexpr double kThreshold = 0.016;  // 8 px of a view

struct Matches {
  std::vector<Eigen::Vector3d> rays, points;
  int agreeing = 0;  // with the true pose, the picture taken as it is
};

// Matches of a panorama in a street, a share of them wrong, seen with elevations `factor` times too large.
Matches Seen(double factor, double wrong, uint64_t seed) {
  constexpr int kMatches = 300;
  Random random(seed);
  const Rigid3d rig_from_world(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY())), {0.4, 0.1, -0.8});
  Matches m;
  for (int i = 0; i < kMatches; ++i) {
    const double azimuth = random.Uniform(-M_PI, M_PI), distance = random.Uniform(4, 30);
    const Eigen::Vector3d seen(distance * std::sin(azimuth), random.Uniform(-8, 2), distance * std::cos(azimuth));
    Eigen::Vector3d ray = seen + 0.002 * distance * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    if (random.Uniform() < wrong) ray = {random.Normal(), 0.3 * random.Normal(), random.Normal()};
    m.points.push_back(rig_from_world.Inverse() * seen);
    const double elevation = factor * std::atan2(ray.y(), std::hypot(ray.x(), ray.z()));
    const double heading = std::atan2(ray.x(), ray.z());
    m.rays.emplace_back(std::sin(heading) * std::cos(elevation), std::sin(elevation),
                        std::cos(heading) * std::cos(elevation));
    m.agreeing += (seen.normalized() - m.rays.back()).norm() < kThreshold ? 1 : 0;
  }
  return m;
}

double ShownBy(const Matches& m, uint64_t seed) {
  StretchVotes votes{m.agreeing, VoteForStretch(m.rays, m.points, kThreshold, seed)};
  votes.as_it_is = std::max(votes.as_it_is, votes.stretched[kStretchFactors / 2]);
  const std::optional<int> shown = StretchShown(votes);
  return shown ? StretchFactor(*shown) : 1;
}

TEST(StretchedPictures, AreFoundWithTheirFactor) {
  for (const double factor : {0.7, 0.85, 1.15, 1.25, 1.5}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      EXPECT_NEAR(ShownBy(Seen(factor, 0.4, seed), seed) / factor, 1, 0.06) << factor << ", seed " << seed;
    }
  }
}

TEST(StretchedPictures, AreNotFoundWhereThereAreNone) {
  for (const double wrong : {0.0, 0.4, 0.8}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      EXPECT_EQ(ShownBy(Seen(1, wrong, seed), seed), 1) << wrong << ", seed " << seed;
    }
  }
}

}  // namespace
}  // namespace trigpoint
