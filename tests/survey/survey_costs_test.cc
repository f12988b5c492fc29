#include "survey/tags/survey_costs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "calib/estimation/random.h"
#include "tests/survey/gradients.h"

namespace trigpoint {
namespace {

const Camera kCamera(CameraModel::kPinhole, 960, 600, {400, 400, 479.5, 299.5});

// Poses at identity, near pi, at 1e-8 and at random.
std::vector<Rigid3d> Poses() {
  Random random(3);
  const auto vector = [&](double size) {
    return Eigen::Vector3d(size * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
  };
  std::vector<Rigid3d> poses;
  for (const double angle : {0.0, 3.1415, 1e-8, 0.7}) {
    poses.emplace_back(ExpSO3(angle * vector(1).normalized()), vector(2));
  }
  return poses;
}

void ExpectGradients(const ceres::CostFunction& cost, const std::vector<Rigid3d>& poses,
                     std::vector<std::vector<double>> numbers = {}) {
  Rigid3Manifold manifold;
  std::vector<std::array<double, 7>> blocks(poses.size());
  std::vector<const double*> parameters;
  std::vector<const ceres::Manifold*> manifolds;
  for (size_t i = 0; i < poses.size(); ++i) {
    Rigid3ToBlock(poses[i], blocks[i].data());
    parameters.push_back(blocks[i].data());
    manifolds.push_back(&manifold);
  }
  for (const std::vector<double>& block : numbers) parameters.push_back(block.data()), manifolds.push_back(nullptr);
  ExpectDerivatives(cost, manifolds, parameters);
}

TEST(SurveyCosts, GradientsAreRight) {
  const double factor = 1.7;
  const Vector6d factors = (Vector6d() << 1, 2, 3, 0.5, 0.7, 1.1).finished();
  const Vector6d sigma = (Vector6d() << 0.02, 0.02, 0.03, 0.05, 0.05, 0.06).finished();
  for (const Rigid3d& body : Poses()) {
    for (const Rigid3d& turn : Poses()) {
      const Rigid3d cam_from_body(ExpSO3({0.3, -0.2, 0.1}), {0.1, 0.2, 0.3});
      const Rigid3d cam_from_tag(ExpSO3({0.3, 0.4, 1}), {0.2, -0.3, 4});
      const Rigid3d tag = body * cam_from_body.Inverse() * cam_from_tag;
      TagDetection d;
      for (int k = 0; k < 4; ++k) d.corners[k] = *kCamera.Project(cam_from_tag * TagCorner(0.5, k));
      d.corners[2].x() += 0.5;
      const TagSight sight = MakeTagSight(kCamera, d);
      ExpectGradients(TagCost(sight, 0.5, cam_from_body, &factor), {body, tag}, {{0.2}});
      // Away from a difference of pi, where the logarithm has two values.
      ExpectGradients(
          OdometryCost(Rigid3d(ExpSO3({0.01, 0.02, -0.3}), {1, 0.1, 0}), {0.1, -0.2, 0.98}, sigma, factors.data()),
          {body, body * Rigid3d(ExpSO3({0.1, 0, 0.2}), turn.translation)}, {{1.01}, {0.003}});
      ExpectGradients(PointCost({0.1, 0.2, 0.3}, {1, 0, 0}, {1, 2, 3}, {0.1, 0.1, 0.2}), {turn});
      ExpectGradients(ShiftedPointCost({0.1, 0.2, 0.3}, {1, 0, 0}, {1, 2, 3}, {0.1, 0.1, 0.2}), {turn}, {{1, -2, 3}});
      ExpectGradients(DistanceCost(3, 0.01), {body, body * Rigid3d(turn.rotation, {1, 2, 3})});
      ExpectGradients(PosePriorCost(body * Rigid3d(ExpSO3({0.1, 0, 0.2}), {1, 2, 3}), sigma), {body});
      ExpectGradients(GravityCost(Eigen::Vector3d(0.1, 0.2, 0.9).normalized(), 0.01), {turn});
      ExpectGradients(HeightCost(0.3, 0.01), {turn});
      const Eigen::Vector3d point = body * (cam_from_body.Inverse() * Eigen::Vector3d(0.2, 0.1, 3));
      ExpectGradients(MarkCost(kCamera.BearingSqrtInfo({500, 300}, 0.7), cam_from_body), {body},
                      {{point.x(), point.y(), point.z()}});
      ExpectGradients(TagPixelCost(kCamera, d, sight.sigma_px, 0.5, cam_from_body, &factor), {body, tag},
                      {{0.01, 2, -1, 0.02, -0.01}});
    }
  }
}

TEST(SurveyCosts, CornersFartherOutGiveAShift) {
  const double one = 1;
  const Rigid3d cam_from_tag(ExpSO3({0.3, 0.4, 1}), {0.2, -0.3, 4});
  TagDetection d;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (int k = 0; k < 4; ++k) {
    d.corners[k] = *kCamera.Project(cam_from_tag * TagCorner(0.5, k));
    centre += 0.25 * d.corners[k];
  }
  for (Eigen::Vector2d& corner : d.corners) corner -= 0.25 * (corner - centre).normalized();
  const TagCost cost(MakeTagSight(kCamera, d), 0.5, {}, &one);
  std::array<double, 7> body, tag;
  Rigid3ToBlock({}, body.data());
  Rigid3ToBlock(cam_from_tag, tag.data());
  for (const double shift : {0.0, 0.25}) {
    const double* const blocks[] = {body.data(), tag.data(), &shift};
    Vector8d r;
    cost.Evaluate(blocks, r.data(), nullptr);
    EXPECT_NEAR(r.norm(), shift == 0 ? 0.5 : 0, 0.02);
  }
}

}  // namespace
}  // namespace trigpoint
