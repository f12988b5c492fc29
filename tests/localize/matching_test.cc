// Matching and two-view verification on features whose partners are known.
#include "localize/reconstruct/matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <random>

#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "localize/reconstruct/features.h"
#include "localize/reconstruct/shared_features.h"
#include "localize/reconstruct/two_view.h"
#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

// Two views of 400 points, 0.6 m and 4 deg apart.
struct Pair {
  Camera camera = Camera::FromFieldOfView(960, 600, 1.5);
  Rigid3d b_from_a;
  test::SeenFeatures a, b;
};

Pair MakePair(double sigma_px, uint64_t copies_every = 0) {
  Pair pair;
  pair.b_from_a = {ExpSO3({0.01, 0.07, -0.02}), Eigen::Vector3d(-0.6, 0.02, -0.1)};
  std::vector<Eigen::Vector3d> points;
  std::vector<uint64_t> spots;
  Random random(4);
  for (uint64_t j = 0; j < 400; ++j) {
    points.emplace_back(random.Uniform(-8, 8), random.Uniform(-4, 4), random.Uniform(5, 20));
    spots.push_back(copies_every > 0 ? j % copies_every : j);
  }
  pair.a = test::See(pair.camera, Rigid3d(), points, spots, 1e3, sigma_px, 1);
  pair.b = test::See(pair.camera, pair.b_from_a, points, spots, 1e3, sigma_px, 2);
  return pair;
}

// Share of matches that show the same point, and how many of the points that both see are found.
std::pair<double, double> Quality(const Pair& pair, const Matches& matches) {
  int right = 0;
  for (const auto& [i, j] : matches)
    right += pair.a.points[static_cast<size_t>(i)] == pair.b.points[static_cast<size_t>(j)];
  int both = 0;
  for (int p : pair.a.points) both += std::find(pair.b.points.begin(), pair.b.points.end(), p) != pair.b.points.end();
  return {static_cast<double>(right) / std::max<double>(1, static_cast<double>(matches.size())),
          static_cast<double>(right) / both};
}

TEST(Matching, DistancesAreThoseOfRootSift) {
  const Pair pair = MakePair(0);
  const DescriptorBlock a(pair.a.features.descriptors), b(pair.b.features.descriptors);
  const cv::Mat ra = RootSift(pair.a.features.descriptors), rb = RootSift(pair.b.features.descriptors);
  std::vector<int> distances;
  a.SquaredDistances(3, b, {0, 7, 7, 20}, &distances);
  ASSERT_EQ(distances.size(), 4U);
  const std::vector<int> rows{0, 7, 7, 20};
  for (size_t k = 0; k < rows.size(); ++k) {
    EXPECT_EQ(distances[k], static_cast<int>(cv::norm(ra.row(3), rb.row(rows[k]), cv::NORM_L2SQR)));
  }
}

TEST(Matching, MutualIsTheBruteForceAnswer) {
  const Pair pair = MakePair(0.5);
  const DescriptorBlock a(pair.a.features.descriptors), b(pair.b.features.descriptors);
  const Matches matches = MatchMutual(a, b, 0.85, 0.8);
  // Nearest both ways, by plain loops.
  std::vector<int> all(static_cast<size_t>(b.size())), distances;
  for (size_t j = 0; j < all.size(); ++j) all[j] = static_cast<int>(j);
  std::map<int, int> nearest;
  for (int i = 0; i < a.size(); ++i) {
    a.SquaredDistances(i, b, all, &distances);
    nearest[i] = static_cast<int>(std::min_element(distances.begin(), distances.end()) - distances.begin());
  }
  for (const auto& [i, j] : matches) EXPECT_EQ(nearest[i], j);
  const auto [precision, recall] = Quality(pair, matches);
  EXPECT_EQ(precision, 1);
  EXPECT_GT(recall, 0.95);
}

TEST(Matching, NothingMatchesNothing) {
  const Pair pair = MakePair(0.5);
  const DescriptorBlock a(pair.a.features.descriptors), none;
  EXPECT_TRUE(MatchMutual(a, none, 0.85, 0.8).empty());
  EXPECT_TRUE(MatchMutual(none, a, 0.85, 0.8).empty());
  EXPECT_TRUE(MatchFlann(pair.a.features.descriptors, cv::Mat(), 0.7).empty());
}

TEST(Matching, FlannFindsThem) {
  const Pair pair = MakePair(0.5);
  const auto [precision, recall] =
      Quality(pair, MatchFlann(pair.a.features.descriptors, pair.b.features.descriptors, 0.7));
  EXPECT_GT(precision, 0.99);
  EXPECT_GT(recall, 0.9);
}

// Descriptors that are all alike: an approximate search finds one or another of them, by its trees.
TEST(Matching, FlannFindsTheSameWhateverWasBuiltBefore) {
  cv::RNG random(7);
  cv::Mat a(2000, 128, CV_8U), b(2000, 128, CV_8U);
  random.fill(a, cv::RNG::UNIFORM, 0, 60);
  random.fill(b, cv::RNG::UNIFORM, 0, 60);
  const Matches first = MatchFlann(a, b, 0.999);
  EXPECT_GT(first.size(), 100U);
  for (int k = 0; k < 3; ++k) {
    MatchFlann(b, a, 0.9);
    cv::theRNG().next();
    EXPECT_EQ(MatchFlann(a, b, 0.999), first);
  }
}

// Every spot is there ten times: descriptors alone are helpless, epipolar curves are not.
TEST(Matching, GuidedTellsCopiesApart) {
  const Pair pair = MakePair(0.3, 40);
  const DescriptorBlock a(pair.a.features.descriptors), b(pair.b.features.descriptors);
  const FeatureGrid grid(pair.b.features.points, 960, 600, 12.0F);
  GuidedOptions options;
  options.epipolar_px = 2;
  const Matches guided =
      MatchGuided(pair.a.features, a, test::Rays(pair.camera, pair.a.features), pair.b.features, b,
                  test::Rays(pair.camera, pair.b.features), grid, pair.camera, pair.b_from_a, options);
  const auto [precision, recall] = Quality(pair, guided);
  const auto [blind_precision, blind_recall] = Quality(pair, MatchMutual(a, b, 0.85, 0.8));
  EXPECT_GT(precision, 0.9);
  EXPECT_GT(recall, 0.5);
  EXPECT_LT(blind_recall, 0.2);
}

TEST(TwoView, RefinesAPriorAndLeavesOutliersOut) {
  const Pair pair = MakePair(0.3);
  const DescriptorBlock a(pair.a.features.descriptors), b(pair.b.features.descriptors);
  Matches matches = MatchMutual(a, b, 0.85, 0.8);
  const size_t right = matches.size();
  Random random(9);
  for (int k = 0; k < 60; ++k)
    matches.emplace_back(static_cast<int>(random.Below(static_cast<uint64_t>(a.size()))),
                         static_cast<int>(random.Below(static_cast<uint64_t>(b.size()))));
  std::vector<Eigen::Vector3d> ra, rb;
  const auto rays_a = test::Rays(pair.camera, pair.a.features), rays_b = test::Rays(pair.camera, pair.b.features);
  for (const auto& [i, j] : matches) {
    ra.push_back(rays_a[static_cast<size_t>(i)]);
    rb.push_back(rays_b[static_cast<size_t>(j)]);
  }
  TwoViewOptions options;
  options.inlier_rad = 2 / pair.camera.MeanFocal();
  Rigid3d prior = pair.b_from_a;
  prior.rotation = ExpSO3({0.01, -0.01, 0.005}) * prior.rotation;
  const TwoViewResult near = VerifyTwoView(ra, rb, prior, options);
  EXPECT_FALSE(near.used_ransac);
  EXPECT_LT(AngleBetween(near.b_from_a.rotation, pair.b_from_a.rotation), 0.05 * kDegToRad);
  EXPECT_NEAR(near.b_from_a.translation.norm(), prior.translation.norm(), 1e-9);
  int kept = 0;
  for (int k : near.inliers) kept += static_cast<size_t>(k) < right;
  EXPECT_GT(kept, static_cast<int>(0.95 * static_cast<double>(right)));
  EXPECT_LT(near.inliers.size() - static_cast<size_t>(kept), 15U);

  // A prior that is 40 deg off: the images have their say.
  prior.rotation = ExpSO3({0, 0.7, 0}) * pair.b_from_a.rotation;
  prior.translation = Eigen::Vector3d(0, 0, 0.6);
  const TwoViewResult far = VerifyTwoView(ra, rb, prior, options);
  EXPECT_TRUE(far.used_ransac);
  EXPECT_LT(AngleBetween(far.b_from_a.rotation, pair.b_from_a.rotation), 0.2 * kDegToRad);
  EXPECT_LT(AngleBetween(far.b_from_a.translation, pair.b_from_a.translation), 2 * kDegToRad);
}

// Matched rays of a pair, true ones first, and as many random ones as asked for.
struct MatchedRays {
  std::vector<Eigen::Vector3d> a, b;
  size_t right = 0;
};
MatchedRays RaysWithOutliers(const Pair& pair, int random_ones) {
  const DescriptorBlock a(pair.a.features.descriptors), b(pair.b.features.descriptors);
  Matches matches = MatchMutual(a, b, 0.85, 0.8);
  MatchedRays rays;
  rays.right = matches.size();
  Random random(9);
  for (int k = 0; k < random_ones; ++k)
    matches.emplace_back(static_cast<int>(random.Below(static_cast<uint64_t>(a.size()))),
                         static_cast<int>(random.Below(static_cast<uint64_t>(b.size()))));
  const auto rays_a = test::Rays(pair.camera, pair.a.features), rays_b = test::Rays(pair.camera, pair.b.features);
  for (const auto& [i, j] : matches) {
    rays.a.push_back(rays_a[static_cast<size_t>(i)]);
    rays.b.push_back(rays_b[static_cast<size_t>(j)]);
  }
  return rays;
}

TEST(WideBaseline, FindsThePoseWithoutAPriorAndStatesItsInformation) {
  const Pair pair = MakePair(0.3);
  const MatchedRays rays = RaysWithOutliers(pair, 400);
  WideBaselineOptions options;
  options.inlier_rad = 2 / pair.camera.MeanFocal();
  Rigid3d prior = pair.b_from_a;
  prior.rotation = ExpSO3({0.3, -0.2, 0.1}) * prior.rotation;
  const WideBaselineResult result = VerifyWideBaseline(rays.a, rays.b, prior, options);
  ASSERT_TRUE(result.verified);
  EXPECT_LT(result.log10_false_alarms, -20);
  EXPECT_FALSE(result.rotation_only);
  EXPECT_LT(AngleBetween(result.b_from_a.rotation, pair.b_from_a.rotation), 0.2 * kDegToRad);
  EXPECT_LT(AngleBetween(result.b_from_a.translation, pair.b_from_a.translation), 2 * kDegToRad);
  EXPECT_GT(result.information.diagonal().minCoeff(), 0);
}

// A prior that is known well along one axis of its tangent plane and hardly along the other; the truth lies along the
// latter. Between the two directions the smallest component changes, and with it the axes of TangentBasis.
TEST(WideBaseline, ItsPriorHasTheAxesOfItsOwnDirection) {
  constexpr double kOff_rad = 8 * kDegToRad, kKnown_rad = 0.1 * kDegToRad, kUnknown_rad = 10 * kDegToRad;
  constexpr int kPoints = 400;
  const Eigen::Vector3d from = Eigen::Vector3d(0.52, 0.48, -0.7).normalized();
  const Eigen::Quaterniond rotation = ExpSO3({0.01, 0.07, -0.02});
  const auto smallest = [](const Eigen::Vector3d& v) {
    Eigen::Index axis = 0;
    v.cwiseAbs().minCoeff(&axis);
    return axis;
  };
  int changed = 0;
  for (const Eigen::Index loose : {0, 1}) {
    for (const double off : {-kOff_rad, kOff_rad}) {
      const Eigen::Vector3d along = TangentBasis(from).row(loose).transpose();
      const Eigen::Vector3d to = std::cos(off) * from + std::sin(off) * along;
      changed += smallest(to) != smallest(from) ? 1 : 0;
      const Rigid3d b_from_a(rotation, 0.6 * to);
      Random random(4);
      std::vector<Eigen::Vector3d> a, b;
      for (int j = 0; j < kPoints; ++j) {
        const Eigen::Vector3d point(random.Uniform(-8, 8), random.Uniform(-4, 4), random.Uniform(5, 20));
        a.push_back(point.normalized());
        b.push_back((b_from_a * point).normalized());
      }
      WideBaselineOptions options;
      Eigen::Matrix<double, 5, 1> sigma;
      sigma << Eigen::Vector3d::Constant(kDegToRad), Eigen::Vector2d::Constant(kKnown_rad);
      sigma(3 + loose) = kUnknown_rad;
      options.prior_covariance = sigma.cwiseAbs2().asDiagonal();
      const WideBaselineResult found = VerifyWideBaseline(a, b, Rigid3d(rotation, 0.6 * from), options);
      ASSERT_TRUE(found.verified);
      EXPECT_LT(AngleBetween(found.b_from_a.translation, to), 0.1 * kDegToRad) << loose << " " << off;
    }
  }
  EXPECT_GT(changed, 0);
}

// Pictures of a camera that stands still have no parallax, and share what they see nevertheless.
TEST(SharedFeatures, AreThoseOfACameraThatStandsStill) {
  QuickFeatures a, b;
  cv::Mat descriptors(60, DescriptorBlock::kDim, CV_8U);
  cv::RNG noise(3);
  noise.fill(descriptors, cv::RNG::UNIFORM, 0, 120);
  a.descriptors = b.descriptors = DescriptorBlock(descriptors);
  a.pixel_rad = b.pixel_rad = 2e-3;
  Random random(5);
  for (int k = 0; k < descriptors.rows; ++k) {
    const Eigen::Vector3d ray(random.Uniform(-0.8, 0.8), random.Uniform(-0.5, 0.5), 1);
    const auto seen = [&] {
      return (ray + a.pixel_rad * Eigen::Vector3d(random.Uniform(-2, 2), random.Uniform(-2, 2), 0)).normalized();
    };
    a.rays.push_back(ray.normalized());
    b.rays.push_back(seen());
  }
  const SharedView still = CompareViews(a, b, {});
  EXPECT_EQ(still.matches, descriptors.rows);
  EXPECT_GT(still.features, 40);
  // Elsewhere without a pose: alike, and nothing shared.
  std::shuffle(b.rays.begin(), b.rays.end(), std::mt19937(7));
  const SharedView other = CompareViews(a, b, {});
  EXPECT_EQ(other.matches, descriptors.rows);
  EXPECT_EQ(other.features, 0);
}

TEST(WideBaseline, RefusesWhatChanceMakes) {
  const Pair pair = MakePair(0.3);
  MatchedRays rays = RaysWithOutliers(pair, 300);
  rays.a.erase(rays.a.begin(), rays.a.begin() + static_cast<std::ptrdiff_t>(rays.right));
  rays.b.erase(rays.b.begin(), rays.b.begin() + static_cast<std::ptrdiff_t>(rays.right));
  WideBaselineOptions options;
  options.inlier_rad = 2 / pair.camera.MeanFocal();
  EXPECT_FALSE(VerifyWideBaseline(rays.a, rays.b, pair.b_from_a, options).verified);
}

// A bonnet in the picture stands still while all else moves.
TEST(WithoutCarrier, LeavesOutWhatIsFixedToTheCamera) {
  const Camera camera = Camera::FromFieldOfView(960, 600, 1.5);
  const double pixel_rad = 1 / camera.MeanFocal();
  Random random(2);
  std::vector<Eigen::Vector3d> a, b;
  Matches matches;
  const auto add = [&](double moved_px) {
    const Eigen::Vector2d pixel(random.Uniform(100, 800), random.Uniform(50, 550));
    const Eigen::Vector2d noise(0.3 * random.Normal(), 0.3 * random.Normal());
    a.push_back(*camera.Unproject(pixel));
    b.push_back(*camera.Unproject(pixel + Eigen::Vector2d(moved_px, 0) + noise));
    matches.emplace_back(static_cast<int>(a.size()) - 1, static_cast<int>(a.size()) - 1);
  };
  for (int k = 0; k < 60; ++k) add(0);
  for (int k = 0; k < 40; ++k) add(random.Uniform(10, 60));
  EXPECT_EQ(WithoutCarrier(matches, a, b, pixel_rad).size(), 40U);
  // Straight ahead, what is far away hardly moves, and there is no gap: all of it is scene.
  for (int k = 0; k < 30; ++k) add(random.Uniform(1.5, 6));
  EXPECT_EQ(WithoutCarrier(matches, a, b, pixel_rad).size(), 130U);
  // The camera stands, and 25 wrong matches move.
  a.clear(), b.clear(), matches.clear();
  for (int k = 0; k < 400; ++k) add(0);
  for (int k = 0; k < 25; ++k) add(random.Uniform(10, 60));
  EXPECT_EQ(WithoutCarrier(matches, a, b, pixel_rad).size(), 425U);
  // Nothing moves.
  EXPECT_EQ(WithoutCarrier({matches.begin(), matches.begin() + 60}, a, b, pixel_rad).size(), 60U);
}

}  // namespace
}  // namespace trigpoint
