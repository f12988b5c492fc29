#include "calib/geometry/alignment.h"

#include <gtest/gtest.h>

#include "calib/base/error.h"
#include "tests/support/numeric.h"

namespace trigpoint {
namespace {

std::vector<Eigen::Vector3d> Points(Random& random, int n, const Eigen::Vector3d& extent) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < n; ++i) points.push_back(extent.cwiseProduct(RandomNormal3(random)));
  return points;
}

std::vector<Eigen::Vector3d> Mapped(const Sim3d& t, const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> mapped;
  for (const Eigen::Vector3d& p : points) mapped.push_back(t * p);
  return mapped;
}

double Cost(const Sim3d& t, const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target) {
  double cost = 0;
  for (size_t i = 0; i < source.size(); ++i) cost += (target[i] - t * source[i]).squaredNorm();
  return cost;
}

Sim3d RandomTransform(AlignmentKind kind, Random& random) {
  Sim3d t;
  t.rotation =
      kind == AlignmentKind::kYawTranslation ? ExpSO3({0, 0, random.Uniform(-3.1, 3.1)}) : RandomRotation(random);
  if (kind == AlignmentKind::kSim3) t.scale = random.Uniform(0.3, 3);
  t.translation = 20 * RandomNormal3(random);
  return t;
}

const AlignmentKind kKinds[] = {AlignmentKind::kYawTranslation, AlignmentKind::kSE3, AlignmentKind::kSim3};

TEST(Alignment, RecoversTheTruthForSpacePlaneAndFewPoints) {
  Random random(1);
  for (const AlignmentKind kind : kKinds) {
    for (const Eigen::Vector3d& extent : {Eigen::Vector3d(5, 4, 3), Eigen::Vector3d(30, 20, 0)}) {
      for (const int n : {3, 4, 50}) {
        const auto source = Points(random, n, extent);
        const Sim3d truth = RandomTransform(kind, random);
        const Sim3d found = AlignPoints(source, Mapped(truth, source), kind);
        EXPECT_NEAR(found.scale, truth.scale, 1e-10);
        EXPECT_LT(AngleBetween(found.rotation, truth.rotation), 1e-7);
        EXPECT_LT((found.translation - truth.translation).norm(), 1e-6);
      }
    }
  }
}

TEST(Alignment, IsAMinimum) {
  Random random(2);
  for (const AlignmentKind kind : kKinds) {
    const auto source = Points(random, 20, {5, 4, 3});
    auto target = Mapped(RandomTransform(kind, random), source);
    for (Eigen::Vector3d& p : target) p += 0.3 * RandomNormal3(random);
    const Sim3d best = AlignPoints(source, target, kind);
    const double cost = Cost(best, source, target);
    for (int i = 0; i < 200; ++i) {
      Sim3d other = best;
      Eigen::Vector3d w = 1e-3 * RandomNormal3(random);
      if (kind == AlignmentKind::kYawTranslation) w.head<2>().setZero();
      other.rotation = ExpSO3(w) * other.rotation;
      other.translation += 1e-3 * RandomNormal3(random);
      if (kind == AlignmentKind::kSim3) other.scale *= 1 + 1e-3 * random.Normal();
      EXPECT_GT(Cost(other, source, target), cost);
    }
  }
}

TEST(Alignment, DoesNotDependOnWhereTheWorldIs) {
  Random random(3);
  for (const AlignmentKind kind : kKinds) {
    const auto source = Points(random, 20, {5, 4, 3});
    auto target = Mapped(RandomTransform(kind, random), source);
    for (Eigen::Vector3d& p : target) p += 0.3 * RandomNormal3(random);
    const Sim3d here = AlignPoints(source, target, kind);
    const Sim3d move = RandomTransform(kind == AlignmentKind::kSim3 ? AlignmentKind::kSE3 : kind, random);
    const Sim3d there = AlignPoints(source, Mapped(move, target), kind), expected = move * here;
    EXPECT_NEAR(there.scale, expected.scale, 1e-10);
    EXPECT_LT(AngleBetween(there.rotation, expected.rotation), 1e-9);
    EXPECT_LT((there.translation - expected.translation).norm(), 1e-8);
  }
}

TEST(Alignment, NeverReflects) {
  Random random(4);
  const auto source = Points(random, 10, {5, 4, 3});
  auto target = source;
  for (Eigen::Vector3d& p : target) p.x() = -p.x();
  for (const AlignmentKind kind : {AlignmentKind::kSE3, AlignmentKind::kSim3}) {
    EXPECT_NEAR(AlignPoints(source, target, kind).rotation.toRotationMatrix().determinant(), 1, 1e-12);
  }
}

TEST(Alignment, PointsOnALineTakeTheSmallestRotation) {
  const std::vector<Eigen::Vector3d> source = {{100, 0, 0}, {101, 0, 0}, {103, 0, 0}, {110, 0, 0}};
  const Eigen::Quaterniond turn = ExpSO3({0, 0, 0.4});  // the smallest that takes x to its image
  const auto target = Mapped({1, turn, {5, 6, 7}}, source);
  for (const AlignmentKind kind : {AlignmentKind::kSE3, AlignmentKind::kSim3}) {
    const Sim3d found = AlignPoints(source, target, kind);
    EXPECT_LT(AngleBetween(found.rotation, turn), 1e-9);
    EXPECT_LT(Cost(found, source, target), 1e-18);
  }
}

TEST(Alignment, RefusesTooFewAndCoincidentPoints) {
  const std::vector<Eigen::Vector3d> two = {{0, 0, 0}, {1, 0, 0}};
  EXPECT_NO_THROW(AlignPoints(two, two, AlignmentKind::kYawTranslation));
  EXPECT_THROW(AlignPoints(two, two, AlignmentKind::kSE3), NumericError);
  EXPECT_THROW(AlignPoints({}, {}, AlignmentKind::kYawTranslation), NumericError);
  const std::vector<Eigen::Vector3d> same(5, Eigen::Vector3d(1234.567, -89.1, 0.3));
  for (const AlignmentKind kind : kKinds) EXPECT_THROW(AlignPoints(same, same, kind), NumericError);
  const std::vector<Eigen::Vector3d> upright = {{3, 4, 0}, {3, 4, 1}, {3, 4, 5}};
  EXPECT_THROW(AlignPoints(upright, upright, AlignmentKind::kYawTranslation), NumericError);
}

}  // namespace
}  // namespace trigpoint
