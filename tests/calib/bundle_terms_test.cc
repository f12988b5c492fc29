// Derivatives of every term of the bundle adjustment against central differences.
#include "calib/estimation/bundle_terms.h"

#include <gtest/gtest.h>

#include <functional>

#include "calib/camera/camera.h"
#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kStep = 1e-6, kTolerance = 1e-6;

Rigid3d RandomPose(Random* random, double angle, double distance) {
  const auto normal3 = [&](double sigma) {
    return Eigen::Vector3d(sigma * random->Normal(), sigma * random->Normal(), sigma * random->Normal());
  };
  return {ExpSO3(normal3(angle)), normal3(distance)};
}

Matrix6d RandomInfo(Random* random) {
  Matrix6d m;
  for (int k = 0; k < 36; ++k) m(k) = random->Normal();
  return m;
}

TEST(BundleTerms, ObservationDerivatives) {
  Random random(1);
  const Camera camera = Camera::FromFieldOfView(800, 600, 1.5);
  for (int trial = 0; trial < 50; ++trial) {
    BundleProblem p;
    p.poses = {RandomPose(&random, 1.0, 3.0)};
    p.views = {RandomPose(&random, 1.0, 0.2)};
    // Anywhere in the image, its middle included: the residual has no singular axis.
    const Eigen::Vector2d pixel =
        trial == 0 ? Eigen::Vector2d(399.5, 299.5) : Eigen::Vector2d(random.Uniform(5, 795), random.Uniform(5, 595));
    const Eigen::Vector3d ray = *camera.Unproject(pixel);
    const Rigid3d view_from_world = p.views[0] * p.poses[0];
    const Eigen::Vector3d off(0.01 * random.Normal(), 0.01 * random.Normal(), 0.01 * random.Normal());
    const Eigen::Vector3d y = view_from_world.Inverse() * ((ray + off) * random.Uniform(1, 30));
    BearingObservation o;
    o.ray = ray.cast<float>();
    o.w = camera.BearingSqrtInfo(pixel, 0.5).cast<float>();
    ObservationTerms t;
    ASSERT_TRUE(Evaluate<true>(p, o, y, &t));
    const double size = t.jp.norm() + t.jy.norm();
    for (int k = 0; k < 6; ++k) {
      ObservationTerms plus, minus;
      BundleProblem moved = p;
      moved.poses[0] = p.poses[0].Plus(kStep * Vector6d::Unit(k));
      ASSERT_TRUE(Evaluate<false>(moved, o, y, &plus));
      moved.poses[0] = p.poses[0].Plus(-kStep * Vector6d::Unit(k));
      ASSERT_TRUE(Evaluate<false>(moved, o, y, &minus));
      EXPECT_LT(((plus.r - minus.r) / (2 * kStep) - t.jp.col(k)).norm(), kTolerance * size) << "pose " << k;
    }
    for (int k = 0; k < 3; ++k) {
      ObservationTerms plus, minus;
      ASSERT_TRUE(Evaluate<false>(p, o, y + kStep * Eigen::Vector3d::Unit(k), &plus));
      ASSERT_TRUE(Evaluate<false>(p, o, y - kStep * Eigen::Vector3d::Unit(k), &minus));
      EXPECT_LT(((plus.r - minus.r) / (2 * kStep) - t.jy.col(k)).norm(), kTolerance * size) << "point " << k;
    }
  }
}

TEST(BundleTerms, BehindTheViewIsRefused) {
  BundleProblem p;
  p.poses = {Rigid3d()};
  p.views = {Rigid3d()};
  BearingObservation o;
  o.ray = Eigen::Vector3f(0, 0, 1);
  o.w << 1, 0, 0, 0, 1, 0;
  ObservationTerms t;
  EXPECT_TRUE(Evaluate<true>(p, o, {0.1, 0, 2}, &t));
  EXPECT_FALSE(Evaluate<true>(p, o, {0.1, 0, -2}, &t));
  EXPECT_FALSE(Evaluate<true>(p, o, {0, 0, 0}, &t));
}

class FactorDerivatives : public testing::TestWithParam<PoseFactor::Kind> {};

TEST_P(FactorDerivatives, AreThoseOfDifferences) {
  Random random(2);
  for (int trial = 0; trial < 50; ++trial) {
    BundleProblem p;
    p.poses = {RandomPose(&random, 1.0, 3.0), RandomPose(&random, 1.0, 3.0)};
    p.scale = 1.1;
    PoseFactor f;
    f.kind = GetParam();
    f.a = 0;
    f.b = f.kind == PoseFactor::Kind::kBetween || f.kind == PoseFactor::Kind::kTwoView ? 1 : -1;
    p.views = {RandomPose(&random, 1.0, 0.3), RandomPose(&random, 1.0, 0.3)};
    f.view_a = 1;
    f.scaled = f.kind == PoseFactor::Kind::kBetween;
    // Residuals up to a radian and a metre: the Jacobians hold away from the minimum, too.
    const Rigid3d off = RandomPose(&random, 0.4, 0.5);
    switch (f.kind) {
      case PoseFactor::Kind::kBetween: f.measured = off * p.poses[0] * p.poses[1].Inverse(); break;
      case PoseFactor::Kind::kPrior: f.measured = off * p.poses[0]; break;
      case PoseFactor::Kind::kTwoView:
        f.measured = off * p.views[1] * p.poses[0] * (p.views[0] * p.poses[1]).Inverse();
        f.measured.translation.normalize();
        break;
      default: f.measured = off * p.poses[0].Inverse();
    }
    f.arm = Eigen::Vector3d(0.3, -0.2, 1.0);
    f.sqrt_info = RandomInfo(&random);
    FactorTerms t;
    EvaluateFactor(p, f, &t);
    const double size = t.ja.norm() + t.jb.norm() + t.js.norm() + t.r.norm();
    const auto difference = [&](const std::function<void(BundleProblem*, double)>& move) -> Vector6d {
      FactorTerms plus, minus;
      BundleProblem moved = p;
      move(&moved, kStep);
      EvaluateFactor(moved, f, &plus);
      moved = p;
      move(&moved, -kStep);
      EvaluateFactor(moved, f, &minus);
      return (plus.r - minus.r) / (2 * kStep);
    };
    for (int k = 0; k < 6; ++k) {
      for (size_t pose = 0; pose < 2; ++pose) {
        const Vector6d d = difference([&](BundleProblem* moved, double step) {
          moved->poses[pose] = p.poses[pose].Plus(step * Vector6d::Unit(k));
        });
        const Vector6d stated = pose == 0 ? t.ja.col(k) : t.jb.col(k);
        EXPECT_LT((d - stated).norm(), kTolerance * size) << "pose " << pose << " " << k;
      }
    }
    const Vector6d d = difference([&](BundleProblem* moved, double step) { moved->scale += step; });
    EXPECT_LT((d - t.js).norm(), kTolerance * size);
  }
}
INSTANTIATE_TEST_SUITE_P(Kinds, FactorDerivatives,
                         testing::Values(PoseFactor::Kind::kBetween, PoseFactor::Kind::kPrior,
                                         PoseFactor::Kind::kGeotag, PoseFactor::Kind::kPosition,
                                         PoseFactor::Kind::kTwoView));

}  // namespace
}  // namespace trigpoint
