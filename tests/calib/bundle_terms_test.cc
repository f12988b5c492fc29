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
    p.scales.front().value = 1.1;
    PoseFactor f;
    f.kind = GetParam();
    f.a = 0;
    // In the odom frame or, for a place in the world, with the pose that is world_from_odom.
    const bool place = f.kind == PoseFactor::Kind::kGeotag || f.kind == PoseFactor::Kind::kPosition;
    f.b = f.kind == PoseFactor::Kind::kPrior || (place && trial % 2 == 0) ? -1 : 1;
    p.views = {RandomPose(&random, 1.0, 0.3), RandomPose(&random, 1.0, 0.3)};
    f.view_a = 1;
    f.scale = f.kind == PoseFactor::Kind::kBetween ? 0 : -1;
    // Residuals up to a radian and a metre: the Jacobians hold away from the minimum, too.
    const Rigid3d off = RandomPose(&random, 0.4, 0.5);
    switch (f.kind) {
      case PoseFactor::Kind::kBetween: f.measured = off * p.poses[0] * p.poses[1].Inverse(); break;
      case PoseFactor::Kind::kPrior: f.measured = off * p.poses[0]; break;
      case PoseFactor::Kind::kTwoView:
        f.measured = off * p.views[1] * p.poses[0] * (p.views[0] * p.poses[1]).Inverse();
        f.measured.translation.normalize();
        break;
      default: f.measured = off * (f.b < 0 ? Rigid3d() : p.poses[1]) * p.poses[0].Inverse();
    }
    f.arm = Eigen::Vector3d(0.3, -0.2, 1.0);
    f.sqrt_info = RandomInfo(&random);
    if (f.kind == PoseFactor::Kind::kRigPoint) {
      const Eigen::Vector3d seen = p.views[1] * (p.poses[0] * (p.poses[1].Inverse() * f.arm));
      f.measured.translation = (seen.normalized() + 0.3 * off.translation.normalized()).normalized();
    }
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
    const Vector6d d = difference([&](BundleProblem* moved, double step) { moved->scales.front().value += step; });
    EXPECT_LT((d - t.js).norm(), kTolerance * size);
  }
}
INSTANTIATE_TEST_SUITE_P(Kinds, FactorDerivatives,
                         testing::Values(PoseFactor::Kind::kBetween, PoseFactor::Kind::kPrior,
                                         PoseFactor::Kind::kGeotag, PoseFactor::Kind::kPosition,
                                         PoseFactor::Kind::kTwoView, PoseFactor::Kind::kRigPoint));

TEST(BundleTerms, APointOfARigIsSeenAsAnyPoint) {
  Random random(3);
  BundleProblem p;
  p.poses = {RandomPose(&random, 1.0, 3.0), RandomPose(&random, 1.0, 3.0)};
  p.views = {RandomPose(&random, 1.0, 0.2)};
  BearingObservation o;
  o.ray = Eigen::Vector3f(0.25, -0.5, 1).normalized();
  o.w << 800, 16, -200, 0, 750, 375;
  const Eigen::Vector3d y =
      (p.views[0] * p.poses[0]).Inverse() * (5 * o.ray.cast<double>() + Eigen::Vector3d(0.1, 0, 0));
  PoseFactor f;
  f.kind = PoseFactor::Kind::kRigPoint;
  f.b = 1;
  f.arm = p.poses[1] * y;
  f.measured.translation = o.ray.cast<double>();
  f.sqrt_info.setZero();
  f.sqrt_info.topLeftCorner<2, 3>() = o.w.cast<double>();
  ObservationTerms seen;
  FactorTerms t;
  ASSERT_TRUE(Evaluate<true>(p, o, y, &seen));
  EvaluateFactor(p, f, &t);
  EXPECT_LT((t.r.head<2>() - seen.r).norm(), 1e-9 * seen.r.norm());
  EXPECT_LT((t.ja.topRows<2>() - seen.jp).norm(), 1e-9 * seen.jp.norm());
  // The mirrored ray has no residual of its own: it must never look right.
  p.views[0] = Rigid3d(p.views[0].rotation, p.views[0].translation - 10 * f.measured.translation);
  EvaluateFactor(p, f, &t);
  EXPECT_GT(t.r.norm(), 1e4);
}

TEST(BundleTerms, MapDerivatives) {
  Random random(4);
  BundleProblem p;
  for (int i = 0; i < 4; ++i) p.poses.push_back(RandomPose(&random, 1.0, 3.0));
  MapFactor map;
  map.rigs = {2, 0, 1};
  map.frame = 3;
  for (int rig : map.rigs) {
    map.measured.push_back(RandomPose(&random, 0.3, 0.5) * p.poses[3] * p.poses[static_cast<size_t>(rig)].Inverse());
  }
  map.sqrt_info = Eigen::MatrixXd::NullaryExpr(18, 18, [&] { return random.Normal(); });
  const MapTerms t = EvaluateMap(p, map);
  for (int column = 0; column < 24; ++column) {
    const size_t pose = column < 18 ? static_cast<size_t>(map.rigs[static_cast<size_t>(column / 6)]) : 3;
    BundleProblem plus = p, minus = p;
    plus.poses[pose] = p.poses[pose].Plus(kStep * Vector6d::Unit(column % 6));
    minus.poses[pose] = p.poses[pose].Plus(-kStep * Vector6d::Unit(column % 6));
    const Eigen::VectorXd d = (EvaluateMap(plus, map).r - EvaluateMap(minus, map).r) / (2 * kStep);
    EXPECT_LT((d - t.j.col(column)).norm(), kTolerance * t.j.norm()) << column;
  }
}

}  // namespace
}  // namespace trigpoint
