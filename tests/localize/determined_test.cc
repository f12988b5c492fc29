// Whether points fix the position of what sees them.
#include "localize/references/determined.h"

#include <gtest/gtest.h>

#include <cmath>

#include "calib/camera/camera.h"

namespace trigpoint {
namespace {

constexpr double kSigma_px = 1;

// A camera 3 m from the origin sees twelve points about `distance_m` ahead.
struct Scene {
  BundleProblem problem;
  std::vector<size_t> observations;
  explicit Scene(double distance_m) {
    const Camera camera(CameraModel::kPinhole, 1000, 800, {500, 500, 499.5, 399.5});
    problem.views = {Rigid3d()};
    problem.poses.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                               Eigen::Vector3d(1, 2, 2));
    for (int j = 0; j < 12; ++j) {
      const Eigen::Vector2d pixel(100 + 70 * j, 100 + 190 * (j % 4));
      BearingObservation o;
      o.point = j, o.pose = 0;
      const Eigen::Vector3d ray = *camera.Unproject(pixel);
      o.ray = ray.cast<float>();
      o.w = camera.BearingSqrtInfo(pixel, kSigma_px).cast<float>();
      problem.points.push_back(problem.poses[0].Inverse() * Eigen::Vector3d((1 + 0.1 * (j % 3)) * distance_m * ray));
      observations.push_back(problem.observations.size());
      problem.observations.push_back(o);
    }
  }
  double Sigma() const { return LargestPositionSigma(problem.poses[0], problem, observations); }
};

TEST(Determined, NearPointsFixThePosition) {
  const double sigma = Scene(10).Sigma();
  EXPECT_GT(sigma, kSigma_px / 500 * 10 / std::sqrt(12.0));  // of a direction, by as many points
  EXPECT_LT(sigma, 0.2);
  EXPECT_NEAR(Scene(40).Sigma() / sigma, 4, 0.01);  // in proportion to their distance
}

TEST(Determined, PointsThatHaveGoneFarAwayDoNot) {
  EXPECT_GT(Scene(1e5).Sigma(), 100);
  EXPECT_GT(Scene(1e12).Sigma(), 1e6);
}

TEST(Determined, TwoPointsDoNot) {
  Scene scene(10);
  for (size_t k = 2; k < scene.problem.observations.size(); ++k) scene.problem.observations[k].active = false;
  EXPECT_EQ(scene.Sigma(), INFINITY);
}

}  // namespace
}  // namespace trigpoint
