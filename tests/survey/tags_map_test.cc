#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "survey/tags/selected_inverse.h"
#include "survey/tags/survey_costs.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {
namespace {

const Camera kCamera(CameraModel::kPinhole, 960, 600, {400, 400, 479.5, 299.5});

Eigen::Vector3d RandomVector(Random* random, double size) {
  return size * Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal());
}

// Poses at identity, near pi, at 1e-8 and at random.
std::vector<Rigid3d> Poses() {
  Random random(3);
  std::vector<Rigid3d> poses;
  for (const double angle : {0.0, 3.1415, 1e-8, 0.7}) {
    poses.emplace_back(ExpSO3(angle * RandomVector(&random, 1).normalized()), RandomVector(&random, 2));
  }
  return poses;
}

void ExpectGradients(const ceres::CostFunction& cost, const std::vector<Rigid3d>& poses, double* scalar = nullptr) {
  Rigid3Manifold manifold;
  std::vector<std::array<double, 7>> blocks(poses.size());
  std::vector<const double*> parameters;
  std::vector<const ceres::Manifold*> manifolds;
  for (size_t i = 0; i < poses.size(); ++i) {
    Rigid3ToBlock(poses[i], blocks[i].data());
    parameters.push_back(blocks[i].data());
    manifolds.push_back(&manifold);
  }
  if (scalar != nullptr) parameters.push_back(scalar), manifolds.push_back(nullptr);
  const ceres::NumericDiffOptions options;
  const ceres::GradientChecker checker(&cost, &manifolds, options);
  ceres::GradientChecker::ProbeResults results;
  checker.Probe(parameters.data(), 1e-6, &results);
  ASSERT_TRUE(results.return_value);
  // Against the size of the whole derivative: single entries may be zero.
  for (size_t i = 0; i < parameters.size(); ++i) {
    const auto &exact = results.local_jacobians[i], &numeric = results.local_numeric_jacobians[i];
    EXPECT_LT((exact - numeric).norm(), 1e-6 * (1e-3 + exact.norm())) << results.error_log;
  }
}

TEST(SurveyCosts, GradientsAreRight) {
  const double factor = 1.7;
  double scale = 1.01;
  for (const Rigid3d& body : Poses()) {
    for (const Rigid3d& turn : Poses()) {
      const Rigid3d cam_from_body(ExpSO3({0.3, -0.2, 0.1}), {0.1, 0.2, 0.3});
      const Rigid3d cam_from_tag(ExpSO3({0.3, 0.4, 1}), {0.2, -0.3, 4});
      TagDetection d;
      for (int k = 0; k < 4; ++k) d.corners[k] = *kCamera.Project(cam_from_tag * TagCorner(0.5, k));
      d.corners[2].x() += 0.5;
      ExpectGradients(TagCost(MakeTagSight(kCamera, d), 0.5, cam_from_body, &factor),
                      {body, body * cam_from_body.Inverse() * cam_from_tag});
      // Away from a difference of pi, where the logarithm has two values.
      ExpectGradients(OdometryCost(Rigid3d(ExpSO3({0.01, 0.02, -0.3}), {1, 0.1, 0}), 0.02, 0.05, &factor, &factor),
                      {body, body * Rigid3d(ExpSO3({0.1, 0, 0.2}), turn.translation)}, &scale);
      ExpectGradients(PointCost({0.1, 0.2, 0.3}, {1, 0, 0}, {1, 2, 3}, {0.1, 0.1, 0.2}), {turn});
      ExpectGradients(DistanceCost(3, 0.01), {body, body * Rigid3d(turn.rotation, {1, 2, 3})});
    }
  }
}

TEST(SelectedInverse, EqualsTheInverse) {
  Random random(8);
  const int n = 60;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n, n);
  for (int k = 0; k < 120; ++k) {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(n);
    for (int i = 0; i < 3; ++i) v[random.Below(n)] = random.Normal();
    dense += v * v.transpose();
  }
  dense.diagonal().array() += 0.1;
  const Eigen::SparseMatrix<double> sparse = dense.sparseView();
  const SelectedInverse inverse(sparse);
  const Eigen::MatrixXd expected = dense.inverse();
  for (int k = 0; k < sparse.outerSize(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(sparse, k); it; ++it) {
      EXPECT_NEAR(inverse.At(static_cast<int>(it.row()), static_cast<int>(it.col())), expected(it.row(), it.col()),
                  1e-9);
    }
  }
  EXPECT_LT((inverse.Columns(7, 3) - expected.middleCols(7, 3)).norm(), 1e-8);
  EXPECT_THROW(SelectedInverse(Eigen::SparseMatrix<double>(3, 3)), NumericError);
}

// Eight tags round a yard, two runs inside it with drifting odometry.
struct Yard {
  std::vector<Rigid3d> tags;
  SurveyInput input;
};

Yard MakeYard(uint64_t seed, const Rigid3d& world_from_yard = {}) {
  Yard yard;
  Random random(seed);
  for (int i = 0; i < 8; ++i) {
    const double a = 0.785398 * i;
    Eigen::Matrix3d r;  // z away from the middle, y down
    r.col(2) << std::cos(a), std::sin(a), 0;
    r.col(1) << 0, 0, -1;
    r.col(0) = r.col(1).cross(r.col(2));
    yard.tags.push_back(world_from_yard *
                        Rigid3d(Eigen::Quaterniond(r), {12 * std::cos(a), 12 * std::sin(a), 1 + 0.5 * (i % 3)}));
  }
  yard.input.sizes.size_m = 0.5;
  Eigen::Matrix3d cam_from_body;  // looks to the body's left
  cam_from_body << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  for (int run = 0; run < 2; ++run) {
    SurveyRun survey;
    survey.name = "run" + std::to_string(run + 1);
    BodyCamera camera;
    camera.name = "cam0";
    camera.camera = kCamera;
    camera.cam_from_body = Rigid3d(Eigen::Quaterniond(cam_from_body), {0, 0, 0.1});
    survey.cameras.push_back(camera);
    Rigid3d odom_from_body, before;
    for (int i = 0; i < 80; ++i) {
      const double a = (run == 0 ? 1 : 1.02) * 0.0785398 * i;
      // Body x along the circle, clockwise, so that its left (y) points outwards.
      Eigen::Matrix3d r;
      r.col(1) << std::cos(a), std::sin(a), 0;
      r.col(2) << 0, 0, 1;
      r.col(0) = r.col(1).cross(r.col(2));
      const Rigid3d body = world_from_yard * Rigid3d(Eigen::Quaterniond(r),
                                                     {7 * std::cos(a), 7 * std::sin(a), 0.8 + 0.1 * std::sin(5 * a)});
      if (i > 0) {
        Rigid3d step = before.Inverse() * body;
        const double root = std::sqrt(step.translation.norm());
        step.translation = step.translation / 1.008 + 0.01 * root * RandomVector(&random, 1);
        step.rotation = ExpSO3(0.002 * root * RandomVector(&random, 1)) * step.rotation;
        odom_from_body = odom_from_body * step;
      }
      before = body;
      const int64_t stamp = 500000000LL * i;
      survey.odometry.poses.push_back({stamp, odom_from_body});
      ImageDetections image{stamp, "", "cam0", {}};
      const Rigid3d cam_from_world = camera.cam_from_body * body.Inverse();
      for (int t = 0; t < 8; ++t) {
        TagDetection d;
        d.id = t;
        bool seen = (cam_from_world * yard.tags[t].translation).z() > 1;
        for (int k = 0; k < 4 && seen; ++k) {
          const auto p = kCamera.Project(cam_from_world * (yard.tags[t] * TagCorner(0.5, k)));
          seen = p && kCamera.Contains(*p);
          if (seen) d.corners[k] = *p + 0.2 * Eigen::Vector2d(random.Normal(), random.Normal());
        }
        d.corner_sigma_px.fill(0.2);
        if (seen) image.detections.push_back(d);
      }
      survey.images.push_back(image);
    }
    yard.input.runs.push_back(survey);
  }
  for (int t : {0, 3, 5}) {
    SurveyPoint p;
    p.name = "P" + std::to_string(t);
    p.tag_id = t;
    p.sigma_h_m = p.sigma_v_m = 0.005;
    p.world_m = yard.tags[t].translation + 0.005 * RandomVector(&random, 1);
    yard.input.points.push_back(p);
  }
  SurveyPoint check = yard.input.points.front();
  check.name = "C6";
  check.role = PointRole::kCheck;
  check.tag_id = 6;
  check.world_m = yard.tags[6].translation;
  yard.input.points.push_back(check);
  return yard;
}

SurveyResult Survey(const SurveyInput& input, SurveyOptions options = {}) {
  ProgressSink progress;
  const CancelToken cancel;
  options.extra_sigma_px = 0;
  return SurveyTags(input, options, 2, progress, cancel);
}

TEST(TagMap, RecoversTheYardAndItsUncertaintyIsReal) {
  double nees = 0, worst = 0;
  int n = 0;
  const int redraws = 20;
  for (int seed = 1; seed <= redraws; ++seed) {
    const Yard yard = MakeYard(seed);
    const SurveyResult map = Survey(yard.input);
    EXPECT_EQ(map.datum, "control");
    ASSERT_EQ(map.tags.size(), 8U);
    for (const TagEstimate& tag : map.tags) {
      ASSERT_TRUE(tag.HasPose()) << tag.tag_id << " " << tag.reason;
      const Vector6d e = tag.world_from_tag->Minus(yard.tags[tag.tag_id]);
      worst = std::max(worst, e.tail<3>().norm());
      nees += e.dot(tag.covariance.inverse() * e);
      ++n;
    }
    EXPECT_NEAR(map.runs[0].scale, 1.008, 4 * map.runs[0].scale_sigma);
    EXPECT_EQ(map.check.n, 1);
    EXPECT_LT(map.check.rmse_3d_m, 0.05);
  }
  EXPECT_LT(worst, 0.06);
  // The tags of one map share their errors; the band is that of 20 independent maps with 6 degrees each: +- 25 %.
  EXPECT_GT(nees / n, 6 * 0.65);
  EXPECT_LT(nees / n, 6 * 1.35);
}

TEST(TagMap, TurnsAndShiftsWithTheWorld) {
  const Rigid3d t(ExpSO3({0, 0, 1.1}), {50, -20, 3});  // sigmas of points are horizontal and vertical
  Yard moved = MakeYard(4);
  const SurveyResult one = Survey(moved.input);
  for (SurveyPoint& p : moved.input.points) p.world_m = t * p.world_m;
  const SurveyResult two = Survey(moved.input);
  for (size_t i = 0; i < one.tags.size(); ++i) {
    EXPECT_LT(two.tags[i].world_from_tag->Minus(t * *one.tags[i].world_from_tag).norm(), 1e-4);
  }
}

TEST(TagMap, OneTagHeldAndNoOdometryWorkToo) {
  Yard yard = MakeYard(5);
  yard.input.points.clear();
  yard.input.fixed = FixedTag{2, yard.tags[2]};
  const SurveyResult held = Survey(yard.input);
  EXPECT_EQ(held.datum, "tag 2");
  for (const TagEstimate& tag : held.tags) {
    EXPECT_LT((tag.world_from_tag->translation - yard.tags[tag.tag_id].translation).norm(), 0.3) << tag.tag_id;
  }
}

TEST(TagMap, WrongPicturesAreRejectedAndNothingIsAnError) {
  Yard yard = MakeYard(6);
  int spoiled = 0;
  for (ImageDetections& image : yard.input.runs[0].images) {
    if (!image.detections.empty() && ++spoiled % 12 == 0) {
      image.detections[0].corners[1] += Eigen::Vector2d(25, -10);
    }
  }
  const SurveyResult map = Survey(yard.input);
  EXPECT_GE(map.runs[0].rejected, spoiled / 12);
  for (const TagEstimate& tag : map.tags) {
    EXPECT_LT((tag.world_from_tag->translation - yard.tags[tag.tag_id].translation).norm(), 0.08) << tag.tag_id;
  }
  EXPECT_THROW(Survey(SurveyInput{}), InputError);
}

}  // namespace
}  // namespace trigpoint
