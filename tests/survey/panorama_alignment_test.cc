// Patches laid over one another, and what is left when points are given up.
#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "calib/estimation/marginal_covariance.h"
#include "calib/estimation/random.h"
#include "survey/panorama/patch_alignment.h"

namespace trigpoint {
namespace {

// A smooth random texture, at `at`, with `noise` grey levels.
cv::Mat Texture(int width, int height, const Eigen::Matrix2d& texture_from_pixel, const Eigen::Vector2d& origin,
                double noise, uint64_t seed) {
  Random waves(5), random(seed);
  struct Wave {
    double x, y, phase, height;
  };
  std::vector<Wave> all;
  for (int k = 0; k < 40; ++k) {
    all.push_back({waves.Normal() * 0.25, waves.Normal() * 0.25, waves.Uniform(0, 6.3), waves.Uniform(3, 12)});
  }
  cv::Mat picture(height, width, CV_8U);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector2d t = texture_from_pixel * Eigen::Vector2d(u, v) + origin;
      double grey = 128;
      for (const Wave& w : all) grey += w.height * std::sin(w.x * t.x() + w.y * t.y() + w.phase);
      picture.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(grey + noise * random.Normal());
    }
  }
  return picture;
}

// Of sides that the factor does not make whole, too: each row of the copy is the mean of the rows that it stands for.
TEST(ShrunkPicture, KeepsItsEdges) {
  cv::Mat rows(1003, 1600, CV_32F);
  for (int y = 0; y < rows.rows; ++y) rows.row(y).setTo(y);
  const ShrunkPicture small(rows, 400);
  ASSERT_EQ(small.picture.cols, 400);
  for (int y = 0; y < small.picture.rows; ++y) {
    EXPECT_NEAR(small.picture.at<float>(y, 200), small.ToFull({200, y}).y(), 0.05) << y;
  }
}

PatchImage PatchesOf(const cv::Mat& grey) { return PatchImage(ShrunkPicture(grey, 1600)); }

// Turned by 10 degrees, enlarged by a tenth, in other light and with noise: found to a tenth of what a detector errs,
// and the covariances of many tell how far off they are, up to the one factor that they share.
TEST(AlignPatch, FindsThePlaceThroughTurnZoomAndLight) {
  const double turn = 10 * std::numbers::pi / 180;
  const Eigen::Matrix2d b_from_a =
      1.1 * (Eigen::Matrix2d() << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn)).finished();
  const Eigen::Vector2d origin(-30, 40);
  cv::Mat dim;
  Texture(500, 400, b_from_a.inverse(), -b_from_a.inverse() * origin, 3, 2).convertTo(dim, CV_8U, 0.7, 20);
  const PatchImage a = PatchesOf(Texture(500, 400, Eigen::Matrix2d::Identity(), {0, 0}, 3, 1)), b = PatchesOf(dim);
  Random random(3);
  double square = 0;
  std::vector<double> normalised;
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector2d at(random.Uniform(120, 300), random.Uniform(100, 220)), right = b_from_a * at + origin;
    const Eigen::Vector2d detected = right + 0.4 * Eigen::Vector2d(random.Normal(), random.Normal());
    const auto found = AlignPatch(a, at, b, detected, b_from_a, 2, 0.5);
    ASSERT_TRUE(found) << k;
    const Eigen::Vector2d error = found->pixel - right;
    square += error.squaredNorm() / 600;
    normalised.push_back(error.dot(found->covariance.ldlt().solve(error)) / 2);
  }
  EXPECT_LT(std::sqrt(square), 0.08);
  double mean = 0;
  for (double v : normalised) mean += v / 300;
  EXPECT_GT(mean, 0.3);
  EXPECT_LT(mean, 3);
}

TEST(AlignPatch, KnowsLittleAlongAnEdge) {
  Random random(4);
  const auto noisy_edge = [&] {
    cv::Mat edge(200, 200, CV_8U);
    for (int v = 0; v < 200; ++v) {
      for (int u = 0; u < 200; ++u) {
        edge.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>((u < 100 ? 60 : 180) + 3 * random.Normal());
      }
    }
    return PatchesOf(edge);
  };
  const PatchImage a = noisy_edge(), b = noisy_edge();
  const auto found = AlignPatch(a, {100, 100}, b, {100.4, 100.3}, Eigen::Matrix2d::Identity(), 2, 0.5);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->pixel.x(), 100, 0.1);
  EXPECT_GT(found->covariance(1, 1), 20 * found->covariance(0, 0));
}

TEST(AlignPatch, NothingWhereThePatchesDifferOrLeaveThePicture) {
  const PatchImage a = PatchesOf(Texture(200, 200, Eigen::Matrix2d::Identity(), {0, 0}, 2, 1));
  const PatchImage other = PatchesOf(Texture(200, 200, Eigen::Matrix2d::Identity(), {900, 500}, 2, 1));
  const PatchImage plain = PatchesOf(cv::Mat(200, 200, CV_8U, cv::Scalar(90)));
  const Eigen::Matrix2d same = Eigen::Matrix2d::Identity();
  EXPECT_FALSE(AlignPatch(a, {100, 100}, other, {100, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(a, {100, 100}, plain, {100, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(plain, {100, 100}, plain, {100, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(a, {4, 100}, a, {4, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(a, {100, 100}, a, {198, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(a, {100, 100}, a, {100, 100}, 100 * same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(PatchImage(), {100, 100}, a, {100, 100}, same, 2, 0.5));
  EXPECT_FALSE(AlignPatch(PatchesOf(cv::Mat(20, 20, CV_8U, cv::Scalar(9))), {9, 9}, a, {9, 9}, same, 2, 0.5));
}

// y = (x0 + k x1) + p_j, twice a point: what two blocks say of a line, through points that are found as well.
struct LineCost {
  double k, y;
  int side;
  template <typename T>
  bool operator()(const T* x, const T* p, T* r) const {
    r[0] = x[0] + k * x[1] + (side == 0 ? p[0] : -p[0]) - y;
    return true;
  }
};

// 400 points in 20 groups whose errors are independent, or shared in part by each group.
MarginalCovariance LineWithErrors(double shared, uint64_t seed, double* error2) {
  Random random(seed);
  std::array<double, 2> x = {0, 0};
  std::vector<double> p(400, 0.0);
  std::vector<int> groups;
  ceres::Problem problem;
  for (int j = 0; j < 400; ++j) groups.push_back(j / 20);
  double of_group = 0;
  std::vector<double*> points;
  for (int j = 0; j < 400; ++j) {
    if (j % 20 == 0) of_group = shared * random.Normal();
    for (int side = 0; side < 2; ++side) {
      auto* cost = new LineCost{j / 400.0, std::sqrt(1 - shared * shared) * random.Normal() + of_group, side};
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<LineCost, 1, 2, 1>(cost), nullptr, x.data(),
                               &p[static_cast<size_t>(j)]);
    }
    points.push_back(&p[static_cast<size_t>(j)]);
  }
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const MarginalCovariance found = Marginalise(&problem, {x.data()}, points, {groups});
  const Eigen::Map<const Eigen::Vector2d> at(x.data());
  *error2 = at.dot(found.covariance.ldlt().solve(at)) / 2;
  return found;
}

TEST(Marginalise, IsTheInverseAndSeesErrorsThatGroupsShare) {
  double error2 = 0;
  const MarginalCovariance white = LineWithErrors(0, 1, &error2);
  // Each point leaves the mean of its two: sums over k = j / 400 of [1 k; k k^2] * 2.
  double s1 = 0, s2 = 0;
  for (int j = 0; j < 400; ++j) s1 += j / 400.0, s2 += j / 400.0 * j / 400.0;
  const Eigen::Matrix2d right = (2 * (Eigen::Matrix2d() << 400, s1, s1, s2).finished()).inverse();
  EXPECT_LT((white.covariance - right).norm(), 1e-8);
  double alone = 0, factor_alone = 0, together = 0, factor = 0;
  constexpr int kDraws = 100;
  for (uint64_t seed = 1; seed <= kDraws; ++seed) {
    factor_alone += LineWithErrors(0, seed, &error2).shared / kDraws;
    alone += error2 / kDraws;
    factor += LineWithErrors(0.7, seed, &error2).shared / kDraws;
    together += error2 / kDraws;
  }
  EXPECT_NEAR(factor_alone, 1, 0.15);
  EXPECT_NEAR(alone, 1, 0.3);
  EXPECT_GT(together, 8);  // twenty points count for little more than one
  EXPECT_NEAR(together / factor, 1, 0.35);
}

}  // namespace
}  // namespace trigpoint
