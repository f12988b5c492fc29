#include "calib/geometry/rigid3.h"

#include <gtest/gtest.h>

#include "calib/geometry/path.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

TEST(Rigid3, ComposesInvertsAndTransformsLikeMatrices) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Rigid3d c_from_b = RandomPose(random, 10), b_from_a = RandomPose(random, 10);
    const Eigen::Vector3d p = RandomNormal3(random);
    EXPECT_LT(((c_from_b * b_from_a) * p - c_from_b * (b_from_a * p)).norm(), 1e-13);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * p) - p).norm(), 1e-13);
    EXPECT_LT((b_from_a * b_from_a.TargetOriginInSource()).norm(), 1e-13);
    EXPECT_LT((b_from_a.rotation.toRotationMatrix() * p + b_from_a.translation - b_from_a * p).norm(), 1e-13);
  }
}

TEST(Rigid3, TangentIsRotationFirstAppliedFromTheLeft) {
  const Rigid3d pose(ExpSO3({0.2, 0.4, -0.1}), {1, 2, 3});
  Vector6d delta;
  delta << 0.1, -0.2, 0.3, 4, 5, 6;
  const Rigid3d moved = pose.Plus(delta);
  EXPECT_LT(AngleBetween(moved.rotation, ExpSO3({0.1, -0.2, 0.3}) * pose.rotation), 1e-14);
  EXPECT_LT((moved.translation - Eigen::Vector3d(5, 7, 9)).norm(), 1e-14);
  EXPECT_LT((moved.Minus(pose) - delta).norm(), 1e-14);
}

TEST(Rigid3, InterpolationMeetsItsEndsAndTheMiddle) {
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Rigid3d a = RandomPose(random, 5), b = RandomPose(random, 5);
    EXPECT_LT(Interpolate(a, b, 0).Minus(a).norm(), 1e-12);
    EXPECT_LT(Interpolate(a, b, 1).Minus(b).norm(), 1e-12);
    const Rigid3d middle = Interpolate(a, b, 0.5);
    EXPECT_NEAR(AngleBetween(a.rotation, middle.rotation), AngleBetween(middle.rotation, b.rotation), 1e-12);
    EXPECT_LT((middle.translation - 0.5 * (a.translation + b.translation)).norm(), 1e-13);
  }
}

TEST(Rigid3, InverseCovarianceAgreesWithItsLinearisationAndWithSamples) {
  Random random(3);
  for (int k = 0; k < 3; ++k) {
    const Rigid3d pose = RandomPose(random, 4);
    const Matrix6d covariance = RandomCovariance(random, 0.002, 0.01);
    const Matrix6d predicted = InverseCovariance(pose, covariance);

    const Eigen::MatrixXd j = NumericJacobian(
        [&](const Eigen::VectorXd& d) { return pose.Plus(d).Inverse().Minus(pose.Inverse()); }, Vector6d::Zero());
    EXPECT_LT(CovarianceDeviation(j * covariance * j.transpose(), predicted), 1e-7);

    Matrix6d sampled = Matrix6d::Zero();
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      const Vector6d d = pose.Plus(Draw<6>(covariance, random)).Inverse().Minus(pose.Inverse());
      sampled += d * d.transpose() / n;
    }
    EXPECT_LT(CovarianceDeviation(sampled, predicted), 0.04);  // 5 sigma of 20,000 draws is 0.035 to 0.05
  }
}

TEST(Sim3, ComposesInvertsAndCarriesPoses) {
  Random random(4);
  const Sim3d s{1.7, RandomRotation(random), RandomNormal3(random)},
      t{0.4, RandomRotation(random), RandomNormal3(random)};
  const Eigen::Vector3d p = RandomNormal3(random);
  EXPECT_LT(((s * t) * p - s * (t * p)).norm(), 1e-13);
  EXPECT_LT((s.Inverse() * (s * p) - p).norm(), 1e-13);
  const Rigid3d a_from_x = RandomPose(random, 3);
  const Rigid3d b_from_x = s.TransformPose(a_from_x);
  EXPECT_LT((b_from_x.translation - s * a_from_x.translation).norm(), 1e-13);  // the body's origin
  EXPECT_LT(AngleBetween(b_from_x.rotation, s.rotation * a_from_x.rotation), 1e-14);
}

TEST(PathLengths, AddUpAndDoNotDependOnTheFrame) {
  Random random(5);
  EXPECT_TRUE(PathLengths({}).empty());
  const Rigid3d world_from_odom = RandomPose(random, 10);
  std::vector<Rigid3d> poses, moved;
  double length = 0;
  for (int k = 0; k < 10; ++k) {
    poses.push_back(RandomPose(random, 3));
    moved.push_back(world_from_odom * poses.back());
    if (k > 0) length += (poses[static_cast<size_t>(k) - 1].Inverse() * poses.back()).translation.norm();
    EXPECT_NEAR(PathLengths(poses).back(), length, 1e-12);
    EXPECT_NEAR(PathLengths(moved).back(), length, 1e-12);
  }
}

}  // namespace
}  // namespace trigpoint
