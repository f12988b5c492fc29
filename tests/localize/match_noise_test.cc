// The noise of a panorama's matches, whose points follow them.
#include "localize/references/match_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/base/median.h"
#include "calib/camera/camera.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kStated_px = 1;

// Five images along a path of 2 m see points 6 to 20 m ahead, and a panorama sees the same ones from 3 m further on:
// only it shows their distance well. The images' noise is as stated, the panorama's `noise` times as large.
struct Scene {
  BundleProblem problem;
  std::vector<WeighedMatch> matches;

  Scene(double noise, Random* random) {
    constexpr int kImages = 5, kPoints = 300;
    const Camera camera(CameraModel::kPinhole, 1000, 800, {500, 500, 499.5, 399.5});
    problem.views = {Rigid3d()};
    for (int i = 0; i < kImages; ++i)
      problem.poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.5 * i, 0, 0));
    problem.poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-1, 0, -3));
    problem.pose_constant.assign(problem.poses.size(), true);
    problem.pose_constant.back() = false;
    problem.loss = MakeLoss("none", 1);
    for (int j = 0; j < kPoints; ++j) {
      const Eigen::Vector3d point(random->Uniform(-2, 4), random->Uniform(-2, 2), random->Uniform(6, 20));
      problem.points.push_back(point);
      for (size_t i = 0; i < problem.poses.size(); ++i) {
        const bool of_panorama = i + 1 == problem.poses.size();
        const double sigma_px = kStated_px * (of_panorama ? noise : 1);
        const auto exact = camera.Project(problem.poses[i] * point);
        if (!exact || !camera.Contains(*exact)) continue;
        const Eigen::Vector2d pixel = *exact + sigma_px * Eigen::Vector2d(random->Normal(), random->Normal());
        BearingObservation o;
        o.point = j, o.pose = static_cast<int>(i);
        o.ray = camera.Unproject(pixel)->cast<float>();
        o.w = camera.BearingSqrtInfo(pixel, kStated_px).cast<float>();
        if (of_panorama) matches.push_back({problem.observations.size(), 1});
        problem.observations.push_back(o);
      }
    }
  }
  void Solve() {
    ProgressSink silent;
    SolveBundle(problem, {}, silent, {});
  }
  // As the program does: solved and weighed in turns.
  double Estimate() {
    double estimate = 1;
    for (int round = 0; round < 10; ++round) {
      Solve();
      const double factor = MatchNoise(problem, matches, 6);
      for (const WeighedMatch& m : matches) problem.observations[m.observation].w /= static_cast<float>(factor);
      estimate *= factor;
    }
    return estimate;
  }
  double ByResidualsAlone() const {
    std::vector<double> errors;
    for (const WeighedMatch& m : matches) errors.push_back(SquaredError(problem, problem.observations[m.observation]));
    return SigmaRatio(std::move(errors), 2);
  }
};

TEST(MatchNoise, IsFoundAlthoughPointsFollowTheMatches) {
  constexpr int kDraws = 20;
  for (const double noise : {0.5, 1.0, 2.0}) {
    Random random(3);
    double found = 0, residuals = 0;
    for (int k = 0; k < kDraws; ++k) {
      Scene scene(noise, &random);
      found += scene.Estimate() / kDraws;
      residuals += scene.ByResidualsAlone() / kDraws;
    }
    // 300 points: a median of some 400 residuals is good to 6 %, the mean of 20 draws to 1.3 %.
    EXPECT_NEAR(found / noise, 1, 0.05) << noise;
    // After weighing by the right noise, residuals alone would say less.
    EXPECT_LT(residuals, 0.95) << noise;
  }
}

TEST(MatchNoise, UncertainMatchesCountByTheirProbability) {
  constexpr double kProbability = 0.25;
  Random random(4);
  Scene scene(1, &random);
  for (WeighedMatch& m : scene.matches) {
    m.weight = kProbability;
    scene.problem.observations[m.observation].w *= static_cast<float>(std::sqrt(kProbability));
  }
  // A median of some 400 residuals: two sigmas.
  EXPECT_NEAR(scene.Estimate(), 1, 0.12);
}

TEST(MatchNoise, FewMatchesShowNothing) {
  Random random(5);
  Scene scene(3, &random);
  scene.matches.resize(20);
  EXPECT_EQ(MatchNoise(scene.problem, scene.matches, 6), 1);
}

}  // namespace
}  // namespace trigpoint
