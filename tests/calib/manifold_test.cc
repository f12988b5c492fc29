#include "calib/estimation/manifold.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/covariance.h>
#include <ceres/manifold_test_utils.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

// The macro of manifold_test_utils.h names these without ceres::.
using namespace ceres;  // NOLINT(google-build-using-namespace)

ceres::Vector Block(const Rigid3d& pose) {
  ceres::Vector block(7);
  Rigid3ToBlock(pose, block.data());
  return block;
}

TEST(Rigid3Manifold, HoldsCeresInvariants) {
  const Rigid3Manifold manifold;
  Random random(1);
  const double pi = std::numbers::pi;
  std::vector<Rigid3d> poses = {Rigid3d(), {ExpSO3({pi - 1e-9, 0, 0}), {1, 2, 3}}, {ExpSO3({0, 1e-8, 0}), {0, 0, 0}}};
  for (int i = 0; i < 20; ++i) poses.push_back(RandomPose(random, 3));
  for (const Rigid3d& pose : poses) {
    for (const double size : {0.0, 1e-8, 0.1, 1.0}) {
      ceres::Vector delta(6);
      delta << size * RandomNormal3(random).normalized(), size * RandomNormal3(random);
      const ceres::Vector x = Block(pose), y = Block(RandomPose(random, 3).Plus(delta));
      // Plus(x, Minus(y, x)) is y as a rotation; as a quaternion it may come out as -y.
      Eigen::Matrix<double, 7, 1> y_same_side = y;
      const Eigen::Quaterniond qy(y[3], y[0], y[1], y[2]), qx(x[3], x[0], x[1], x[2]);
      if ((qy * qx.conjugate()).w() < 0) y_same_side.head<4>() *= -1;
      // Tolerances are relative to delta: rounding is 1e-16 of a block, 1e-8 of the smallest delta here.
      EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, ceres::Vector(y_same_side), size == 1e-8 ? 1e-6 : 1e-8);
    }
  }
}

TEST(Rigid3Manifold, TheTangentIsTheFullAngle) {
  const Rigid3Manifold manifold;
  const ceres::Vector x = Block({ExpSO3({0.5, -1, 0.3}), {1, 2, 3}});
  ceres::Vector delta = ceres::Vector::Zero(6), moved(7);
  delta(1) = 0.2;
  manifold.Plus(x.data(), delta.data(), moved.data());
  EXPECT_NEAR(AngleBetween(Rigid3FromBlock(x.data()).rotation, Rigid3FromBlock(moved.data()).rotation), 0.2, 1e-14);
}

TEST(Rigid3Manifold, BlocksAreXYZWAndTranslation) {
  const Rigid3d pose(Eigen::Quaterniond(0.5, 0.1, -0.7, 0.5).normalized(), {4, 5, 6});
  const ceres::Vector block = Block(pose);
  EXPECT_EQ(block(0), pose.rotation.x());
  EXPECT_EQ(block(3), pose.rotation.w());
  EXPECT_EQ(block(6), 6);
  EXPECT_LT(Rigid3FromBlock(block.data()).Minus(pose).norm(), 1e-15);
}

// Known landmarks seen as points in the camera frame, with isotropic noise.
struct PointCost {
  Eigen::Vector3d world, observed;
  double sigma;
  template <typename T>
  bool operator()(const T* block, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(block);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(block + 4);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = (q * world.cast<T>() + t - observed.cast<T>()) / T(sigma);
    return true;
  }
};

TEST(Rigid3Manifold, CovarianceOfAKnownProblemIsTheScatterOfItsAnswers) {
  Random random(5);
  const Rigid3d truth(ExpSO3({0.4, -0.9, 1.3}), {1, -2, 0.5});
  const double sigma = 0.02;
  std::vector<Eigen::Vector3d> world;
  for (int i = 0; i < 6; ++i) world.push_back(3 * RandomNormal3(random));

  // By hand: d(R p + t) / d(w, d) = [-[R p]x, I].
  Matrix6d information = Matrix6d::Zero();
  for (const Eigen::Vector3d& p : world) {
    Eigen::Matrix<double, 3, 6> j;
    j << -Skew(truth.rotation * p), Eigen::Matrix3d::Identity();
    information += j.transpose() * j / (sigma * sigma);
  }
  const Matrix6d by_hand = information.inverse();

  Matrix6d scatter = Matrix6d::Zero(), by_ceres;
  const int draws = 1000;
  for (int k = 0; k < draws; ++k) {
    ceres::Vector block = Block(truth);
    ceres::Problem problem;
    problem.AddParameterBlock(block.data(), 7, new Rigid3Manifold);
    for (const Eigen::Vector3d& p : world) {
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PointCost, 3, 7>(
                                   new PointCost{p, truth * p + sigma * RandomNormal3(random), sigma}),
                               nullptr, block.data());
    }
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    const Vector6d error = Rigid3FromBlock(block.data()).Minus(truth);
    scatter += error * error.transpose() / draws;
    if (k == 0) {
      ceres::Covariance covariance{ceres::Covariance::Options()};
      ASSERT_TRUE(covariance.Compute(std::vector<const double*>{block.data()}, &problem));
      Eigen::Matrix<double, 6, 6, Eigen::RowMajor> c;
      covariance.GetCovarianceBlockInTangentSpace(block.data(), block.data(), c.data());
      by_ceres = c;
    }
  }
  // The first is the linearisation at the estimate instead of the truth; half angles would give a quarter.
  EXPECT_LT(CovarianceDeviation(by_ceres, by_hand), 0.05);
  EXPECT_LT(CovarianceDeviation(scatter, by_hand), 0.2);  // 1,000 draws: 5 sigma are 0.16 to 0.22
}

}  // namespace
}  // namespace trigpoint
