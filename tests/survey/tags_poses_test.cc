#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <filesystem>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "datasets/io/csv.h"
#include "survey/tags/planar_pose.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_poses.h"
#include "survey/tags/tag_shape.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

Rigid3d RandomPose(Random* random, double angle, double metres) {
  const Eigen::Vector3d w(random->Normal(), random->Normal(), random->Normal());
  const Eigen::Vector3d t(random->Normal(), random->Normal(), random->Normal());
  return {ExpSO3(angle * w), metres * t};
}

Vector6d RandomTangent(Random* random) {
  Vector6d d;
  for (int i = 0; i < 6; ++i) d[i] = random->Normal();
  return d;
}

// Detection of a tag in a camera, with noise.
TagDetection Observe(const Camera& camera, const Rigid3d& cam_from_tag, double size_m, int id, double sigma,
                     Random* random) {
  TagDetection d;
  d.id = id;
  for (int k = 0; k < 4; ++k) {
    d.corners[k] = *camera.Project(cam_from_tag * TagCorner(size_m, k)) +
                   sigma * Eigen::Vector2d(random->Normal(), random->Normal());
  }
  d.corner_sigma_px.fill(sigma);
  return d;
}

const Eigen::Quaterniond kNoTurn = Eigen::Quaterniond::Identity();
const Camera kCamera(CameraModel::kPinhole, 960, 600, {400, 400, 479.5, 299.5});

TEST(TagResidual, DerivativesMatchDifferences) {
  Random random(4);
  const Camera fisheye(CameraModel::kKannalaBrandt, 800, 800, {300, 300, 399.5, 399.5, 0.02, -0.01, 0, 0});
  for (const Camera& camera : {kCamera, fisheye}) {
    for (int trial = 0; trial < 10; ++trial) {
      const Rigid3d world_from_body = RandomPose(&random, 1, 5), cam_from_body = RandomPose(&random, 1, 0.3);
      const Rigid3d cam_from_tag(ExpSO3(0.3 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal())),
                                 {0.3 * random.Normal(), 0.3 * random.Normal(), 3});
      const Rigid3d world_from_tag = world_from_body * cam_from_body.Inverse() * cam_from_tag;
      const TagSight sight = MakeTagSight(camera, Observe(camera, cam_from_tag, 0.5, 1, 0.3, &random));
      Matrix86d by_body, by_tag;
      TagResidual(sight, 0.5, cam_from_body, world_from_body, world_from_tag, &by_body, &by_tag);
      for (int i = 0; i < 6; ++i) {
        const Vector6d h = 1e-6 * Vector6d::Unit(i);
        const Vector8d body = (TagResidual(sight, 0.5, cam_from_body, world_from_body.Plus(h), world_from_tag) -
                               TagResidual(sight, 0.5, cam_from_body, world_from_body.Plus(-h), world_from_tag)) /
                              2e-6;
        const Vector8d tag = (TagResidual(sight, 0.5, cam_from_body, world_from_body, world_from_tag.Plus(h)) -
                              TagResidual(sight, 0.5, cam_from_body, world_from_body, world_from_tag.Plus(-h))) /
                             2e-6;
        EXPECT_LT((body - by_body.col(i)).norm(), 1e-4 * (1 + body.norm()));
        EXPECT_LT((tag - by_tag.col(i)).norm(), 1e-4 * (1 + tag.norm()));
      }
    }
  }
}

TEST(PlanarPose, BothSolutionsAreGivenAndTheBetterOneIsTrue) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const Rigid3d cam_from_tag(ExpSO3({0.7 * std::cos(trial), 0.7 * std::sin(trial), 0.2 * trial}),
                               {random.Uniform(-1, 1), random.Uniform(-0.5, 0.5), 2});
    const TagSight sight = MakeTagSight(kCamera, Observe(kCamera, cam_from_tag, 0.5, 1, 0.02, &random));
    const std::vector<PlanarPose> poses = EstimatePlanarPoses(sight, 0.5);
    ASSERT_FALSE(poses.empty());
    EXPECT_LT(AngleBetween(poses[0].cam_from_tag.rotation, cam_from_tag.rotation), 0.02);
    EXPECT_LT((poses[0].cam_from_tag.translation - cam_from_tag.translation).norm(), 0.02);
    EXPECT_LT(poses[0].rms_px, 0.1);
    for (size_t i = 1; i < poses.size(); ++i) EXPECT_GE(poses[i].rms_px, poses[0].rms_px);
  }
}

TEST(PlanarPose, AFarTagHasTwo) {
  Random random(1);
  const Rigid3d cam_from_tag(ExpSO3({0.3, 0.3, 0}), {0, 0, 12});
  const TagSight sight = MakeTagSight(kCamera, Observe(kCamera, cam_from_tag, 0.5, 1, 0.2, &random));
  EXPECT_EQ(EstimatePlanarPoses(sight, 0.5).size(), 2U);
}

// Pictures of one tag from an arc.
std::vector<TagView> Arc(const Rigid3d& world_from_tag, int n, double sigma, Random* random, int id = 7) {
  std::vector<TagView> views;
  for (int i = 0; i < n; ++i) {
    const double a = -0.8 + 1.6 * i / std::max(1, n - 1);
    // Before the tag (its -z side), looking at it.
    const Rigid3d tag_from_cam(ExpSO3({0, -a, 0}), {4 * std::sin(a), 0.3, -4 * std::cos(a)});
    TagView view;
    view.camera = &kCamera;
    view.run = "run1";
    view.world_from_cam = world_from_tag * tag_from_cam;
    view.detections.push_back(Observe(kCamera, tag_from_cam.Inverse(), 0.5, id, sigma, random));
    views.push_back(view);
  }
  return views;
}

TagSizes Sizes() {
  TagSizes sizes;
  sizes.size_m = 0.5;
  return sizes;
}

TagEstimate Estimate(const std::vector<TagView>& views, const TagPosesOptions& options = {}) {
  ProgressSink progress;
  const CancelToken cancel;
  return EstimateTagPoses(views, Sizes(), options, 1, progress, cancel).at(0);
}

// Cameras whose distances are 1.5 % too long; one of nine tags is printed 4 % too large.
TEST(TagShape, TagsShowTheScaleOfTheirCameras) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    std::vector<TagView> views;
    for (int id = 0; id < 9; ++id) {
      for (TagView view : Arc({kNoTurn, {5.0 * id, 0, 0}}, 12, 0.1, &random, id)) {
        view.world_from_cam.translation *= id == 4 ? 0.96 * 1.015 : 1.015;
        views.push_back(view);
      }
    }
    ProgressSink progress;
    const std::vector<TagEstimate> tags = EstimateTagPoses(views, Sizes(), {}, 1, progress, CancelToken());
    const CommonRatio found = CommonSizeRatio(MeasureTagShapes(views, tags, 0.1), 0.02);
    EXPECT_EQ(found.tags, 9);
    EXPECT_NEAR(found.ratio, 1.015, 4 * found.sigma + 0.0005);
    EXPECT_LT(found.sigma, 0.002);
  }
  EXPECT_EQ(CommonSizeRatio({}, 0.02).ratio, 1);
  EXPECT_NEAR(CommonSizeRatio({}, 0.02).sigma, 0.02, 1e-12);
}

TEST(TagPoses, StateHowTheyFollowTheirCameras) {
  Random random(3);
  TagPosesOptions options;
  options.extra_sigma_px = 0;
  for (const bool uncertain : {false, true}) {
    std::vector<TagView> views = Arc(RandomPose(&random, 1, 20), 5, 0.05, &random);
    if (uncertain) {
      for (TagView& view : views) view.covariance = Vector6d(Vector6d::Constant(1e-6)).asDiagonal();
    }
    const TagEstimate tag = Estimate(views, options);
    ASSERT_EQ(tag.by_camera.size(), 5u);
    for (size_t v = 0; v < views.size(); ++v) {
      for (int k = 0; k < 6; ++k) {
        const Rigid3d kept = views[v].world_from_cam;
        views[v].world_from_cam = kept.Plus(1e-4 * Vector6d::Unit(k));
        const Rigid3d ahead = *Estimate(views, options).world_from_tag;
        views[v].world_from_cam = kept.Plus(-1e-4 * Vector6d::Unit(k));
        const Vector6d d = ahead.Minus(*Estimate(views, options).world_from_tag) / 2e-4;
        views[v].world_from_cam = kept;
        EXPECT_LT((d - tag.by_camera[v].col(k)).norm(), 0.02 * (0.1 + d.norm())) << v << " " << k;
      }
    }
  }
}

TEST(TagPoses, RecoverTruthAndStateTheirCovariance) {
  Random random(9);
  const Rigid3d truth = RandomPose(&random, 1, 20);
  TagPosesOptions options;
  options.extra_sigma_px = 0;
  double nees = 0;
  const int runs = 200;
  for (int i = 0; i < runs; ++i) {
    const TagEstimate tag = Estimate(Arc(truth, 6, 0.3, &random), options);
    ASSERT_EQ(tag.status, "ok");
    EXPECT_EQ(tag.images, 6);
    const Vector6d e = tag.world_from_tag->Minus(truth);
    EXPECT_LT(e.tail<3>().norm(), 0.05);
    nees += e.dot(tag.covariance.inverse() * e);
  }
  // Chi-square with 1200 degrees of freedom, 95 %: 1200 +- 96; a variance factor that never falls below one makes the
  // covariance a little larger.
  EXPECT_LT(nees / runs, 6 * 1.08);
  EXPECT_GT(nees / runs, 6 * 0.80);
}

TEST(TagPoses, CovarianceOfCamerasIsCarriedThrough) {
  Random random(11);
  const Rigid3d truth = RandomPose(&random, 1, 20);
  Vector6d sigma;
  sigma << 0.003, 0.004, 0.002, 0.02, 0.03, 0.01;
  for (const double correlation : {0.0, 1.0}) {
    TagPosesOptions options;
    options.extra_sigma_px = 0;
    options.camera_correlation = correlation;
    double nees = 0;
    const int runs = 200;
    for (int i = 0; i < runs; ++i) {
      std::vector<TagView> views = Arc(truth, 6, 0.2, &random);
      Vector6d common = RandomTangent(&random);
      for (TagView& view : views) {
        if (correlation == 0) common = RandomTangent(&random);
        view.world_from_cam = view.world_from_cam.Plus(sigma.cwiseProduct(common));
        view.covariance = sigma.cwiseAbs2().asDiagonal();
      }
      const TagEstimate tag = Estimate(views, options);
      const Vector6d e = tag.world_from_tag->Minus(truth);
      nees += e.dot(tag.covariance.inverse() * e);
    }
    EXPECT_LT(nees / runs, 6 * 1.15) << correlation;
    EXPECT_GT(nees / runs, 6 * 0.75) << correlation;
  }
}

TEST(TagPoses, TurnAndShiftWithTheWorld) {
  Random a(3), b(3);
  const Rigid3d truth(kNoTurn, {1, 2, 3}), moved_from_world(ExpSO3({1, -2, 0.5}), {100, -50, 7});
  const TagEstimate one = Estimate(Arc(truth, 5, 0.3, &a)), two = Estimate(Arc(moved_from_world * truth, 5, 0.3, &b));
  const Rigid3d expected = moved_from_world * *one.world_from_tag;
  EXPECT_LT(two.world_from_tag->Minus(expected).norm(), 1e-6);
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = moved_from_world.rotation.toRotationMatrix();
  EXPECT_LT((turn * one.covariance * turn.transpose() - two.covariance).norm(), 1e-4 * two.covariance.norm());
}

TEST(TagPoses, DuplicatesAndMovedTagsAreNamedNotAveraged) {
  Random random(5);
  const Rigid3d here(kNoTurn, {0, 0, 0}), there(ExpSO3({0, 0.4, 0}), {3, 0, 1});
  std::vector<TagView> views = Arc(here, 8, 0.2, &random);
  for (TagView view : Arc(there, 4, 0.2, &random)) views.push_back(view);
  TagEstimate tag = Estimate(views);
  EXPECT_EQ(tag.status, "duplicate");
  EXPECT_EQ(tag.images, 8);
  EXPECT_LT(tag.world_from_tag->translation.norm(), 0.05);
  EXPECT_NE(tag.reason.find("(3.0"), std::string::npos) << tag.reason;
  for (size_t i = 8; i < views.size(); ++i) views[i].run = "run2";
  tag = Estimate(views);
  EXPECT_EQ(tag.status, "moved");
  EXPECT_EQ(tag.runs, 1);
}

TEST(TagPoses, OneFarPictureIsAmbiguousOrWeak) {
  Random random(5);
  TagView view;
  view.camera = &kCamera;
  view.run = "run1";
  view.detections.push_back(Observe(kCamera, Rigid3d(ExpSO3({0.2, 0.2, 0}), {0, 0, 12}), 0.5, 7, 0.3, &random));
  const TagEstimate tag = Estimate({view});
  EXPECT_EQ(tag.status, "ambiguous");
  EXPECT_FALSE(tag.reason.empty());
}

TEST(TagPoses, ATagWithoutASizeIsOneClearMessage) {
  Random random(5);
  ProgressSink progress;
  const CancelToken cancel;
  try {
    EstimateTagPoses(Arc({}, 3, 0.2, &random), TagSizes{}, {}, 1, progress, cancel);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("tag 7 has no size"), std::string::npos);
  }
}

TEST(TagFiles, DetectionsReadBack) {
  Random random(2);
  std::vector<ImageDetections> images(2);
  images[0] = {
      1000500000000, "images/a b.jpg", "cam0", {Observe(kCamera, Rigid3d(kNoTurn, {0, 0, 3}), 0.5, 3, 0.1, &random)}};
  images[1] = {1001000000000, "images/b,c.jpg", "cam1", images[0].detections};
  const TempDir dir;
  const std::filesystem::path file = dir / "detections.csv";
  WriteDetections(file, images);
  std::vector<std::string> warnings;
  const std::vector<ImageDetections> back = ReadDetections(file, 0.5, &warnings);
  EXPECT_TRUE(warnings.empty());
  ASSERT_EQ(back.size(), 2U);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back[i].stamp_ns, images[i].stamp_ns);
    EXPECT_EQ(back[i].image, images[i].image);
    EXPECT_EQ(back[i].camera, images[i].camera);
    ASSERT_EQ(back[i].detections.size(), 1U);
    EXPECT_NEAR(back[i].detections[0].SigmaPx(), 0.1, 1e-4);
    for (int k = 0; k < 4; ++k) {
      EXPECT_LT((back[i].detections[0].corners[k] - images[i].detections[0].corners[k]).norm(), 1e-3);
    }
  }
}

// Whoever uses the poses takes the size with them: of 1 1/4 in, tenths of a millimetre would be 0.16 % off.
TEST(TagFiles, SizesAreWrittenAsFineAsPositions) {
  TagEstimate tag;
  tag.tag_id = 3;
  tag.size_m = 1.25 * 0.0254;
  const TempDir dir;
  const std::filesystem::path file = dir / "tags.csv";
  WriteTags(file, {tag}, "enu", "control");
  const CsvTable table = CsvTable::Read(file, {"tag_id", "size_m"});
  ASSERT_EQ(table.rows().size(), 1U);
  EXPECT_NEAR(table.rows()[0].Number("size_m"), tag.size_m, 5.1e-7);
}

}  // namespace
}  // namespace trigpoint
