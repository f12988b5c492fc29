#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "calib/camera/pixel_convention.h"
#include "calib/geo/geodetic.h"
#include "tests/synthetic/distractors.h"
#include "tests/synthetic/scene.h"
#include "tests/synthetic/texture.h"

namespace trigpoint {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A wall 6 m x 3 m at 5 m with white discs on black at known places.
constexpr double kPxPerM = 100;
const Vector2d kDiscs[] = {{1.0, 0.7}, {3.0, 1.5}, {5.2, 2.4}, {2.2, 2.3}};  // metres from the top-left corner

Scene DiscWall() {
  cv::Mat picture(300, 600, CV_8UC3, cv::Scalar(0, 0, 0));
  // Drawn by distance: metre m is texel m * kPxPerM - 0.5, and an edge texel is as white as it is covered.
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      for (const Vector2d& disc : kDiscs) {
        const double inside = 0.15 * kPxPerM - (disc * kPxPerM - Vector2d(x + 0.5, y + 0.5)).norm();
        const double white = std::clamp(inside + 0.5, 0.0, 1.0) * 255;
        if (white > 0) picture.at<cv::Vec3b>(y, x) = cv::Vec3b::all(cv::saturate_cast<uchar>(white));
      }
    }
  }
  Scene scene;
  scene.ambient = 1;
  scene.sky_low = scene.sky_high = {0, 0, 0};
  scene.planes.push_back({{-3, 5, 3}, {6, 0, 0}, {0, 0, -3}, std::make_shared<Texture>(picture)});
  return scene;
}

class RenderTest : public testing::TestWithParam<Camera> {};

TEST_P(RenderTest, PaintedDiscsAppearWhereTheCameraModelProjectsThem) {
  const Camera& camera = GetParam();
  const Scene scene = DiscWall();
  const Rigid3d world_from_cam(WorldFromCamRotation({0.1, 0.05, 0.03}), {0.3, 0.2, 1.4});
  const cv::Mat image = Render(scene, camera, world_from_cam, {.supersample = 3, .threads = 2});
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  for (const Vector2d& disc : kDiscs) {
    // The centroid of the disc's outline, projected, against the centroid of what was rendered.
    Vector2d low(1e9, 1e9), high(-1e9, -1e9);
    std::vector<cv::Point2f> outline;
    for (int i = 0; i < 720; ++i) {
      const double a = i * M_PI / 360;
      const Vector3d p(-3 + disc.x() + 0.15 * std::cos(a), 5, 3 - disc.y() + 0.15 * std::sin(a));
      const Vector2d pixel = *camera.Project(world_from_cam.Inverse() * p);
      low = low.cwiseMin(pixel), high = high.cwiseMax(pixel);
      outline.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    }
    const cv::Moments moments = cv::moments(outline);
    const Vector2d expected(moments.m10 / moments.m00, moments.m01 / moments.m00);
    Vector2d sum = Vector2d::Zero();
    double weight = 0;
    for (int y = static_cast<int>(low.y()) - 3; y <= static_cast<int>(high.y()) + 3; ++y) {
      for (int x = static_cast<int>(low.x()) - 3; x <= static_cast<int>(high.x()) + 3; ++x) {
        sum += grey.at<uchar>(y, x) * Vector2d(x, y);
        weight += grey.at<uchar>(y, x);
      }
    }
    EXPECT_NEAR((sum / weight - expected).norm(), 0, 0.03) << expected.transpose();
    EXPECT_NEAR(weight / 255, moments.m00, 0.03 * moments.m00);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cameras, RenderTest,
    testing::Values(Camera::FromFieldOfView(960, 600, 100 * kDegToRad), Camera::Equirectangular(2048, 1024),
                    Camera(CameraModel::kRadtan, 800, 600, {420, 430, 405, 290, -0.2, 0.05, 1e-3, -5e-4}),
                    Camera(CameraModel::kKannalaBrandt, 800, 800, {300, 300, 400, 395, 0.01, -0.004, 0, 0})));

TEST(Render, TheNearerPlaneHidesTheOther) {
  Scene scene = DiscWall();
  const auto red = std::make_shared<Texture>(cv::Mat(8, 8, CV_8UC3, cv::Scalar(0, 0, 200)));
  scene.planes.push_back({{-0.5, 3, 2.5}, {1, 0, 0}, {0, 0, -2}, red});
  const Camera camera = Camera::FromFieldOfView(101, 101, 1);
  const Rigid3d pose(WorldFromCamRotation({0, 0, 0}), {0, 0, 1.5});
  EXPECT_EQ(Render(scene, camera, pose, {}).at<cv::Vec3b>(50, 50), cv::Vec3b(0, 0, 200));
  double distance = 0;
  EXPECT_EQ(FirstHit(scene, pose.translation, Vector3d::UnitY(), &distance), 1);
  EXPECT_NEAR(distance, 3, 1e-5);
  EXPECT_EQ(FirstHit(scene, pose.translation, -Vector3d::UnitY(), &distance), -1);
}

TEST(Render, AFarCheckerboardIsGreyNotAliased) {
  cv::Mat board(512, 512, CV_8UC3);
  for (int y = 0; y < 512; ++y) {
    for (int x = 0; x < 512; ++x)
      board.at<cv::Vec3b>(y, x) = (x + y) % 2 == 0 ? cv::Vec3b(0, 0, 0) : cv::Vec3b(255, 255, 255);
  }
  Scene scene;
  scene.ambient = 1;
  scene.planes.push_back({{-5, 20, 5}, {10, 0, 0}, {0, 0, -10}, std::make_shared<Texture>(board)});
  const cv::Mat image =
      Render(scene, Camera::FromFieldOfView(200, 200, 0.4), {WorldFromCamRotation({0, 0, 0}), {0, 0, 0}}, {});
  cv::Scalar mean, deviation;
  cv::meanStdDev(image(cv::Rect(50, 50, 100, 100)), mean, deviation);
  EXPECT_NEAR(mean[0], 127.5, 2);
  EXPECT_LT(deviation[0], 12);
}

TEST(Render, IsTheSameForAnyNumberOfThreads) {
  const Scene scene = DistractorScene({.width = 256, .facades = 2, .cars = 1, .px_per_m = 10}, 4);
  const Rigid3d pose(WorldFromCamRotation({1, 0, 0}), {0, 0, 1.7});
  RenderOptions options = {.supersample = 2, .blur_sigma_px = 0.5, .noise_sigma = 2, .seed = 3, .threads = 1};
  const cv::Mat one = Render(scene, Camera::FromFieldOfView(160, 120, 1.5), pose, options);
  options.threads = 2;
  const cv::Mat two = Render(scene, Camera::FromFieldOfView(160, 120, 1.5), pose, options);
  EXPECT_EQ(cv::norm(one, two, cv::NORM_INF), 0);
  options.seed = 4;
  EXPECT_GT(cv::norm(one, Render(scene, Camera::FromFieldOfView(160, 120, 1.5), pose, options), cv::NORM_INF), 0);
}

TEST(Render, TagsAreDetectedWhereTheTruthSays) {
  const double size = 0.5, cell = size / 8;
  const Rigid3d world_from_tag(WorldFromCamRotation({0.2, 0.05, 0.02}), {0.4, 4, 1.6});
  const Eigen::Matrix3d r = world_from_tag.rotation.toRotationMatrix();
  Scene scene;
  const Vector3d corner = world_from_tag * Vector3d(-5 * cell, -5 * cell, 0);
  scene.planes.push_back(
      {corner, 10 * cell * r.col(0), 10 * cell * r.col(1), std::make_shared<Texture>(TagTexture(57, 24))});
  const Camera camera = Camera::FromFieldOfView(960, 600, 80 * kDegToRad);
  const Rigid3d world_from_cam(WorldFromCamRotation({0, 0, 0}), {0, 0, 1.5});
  cv::Mat grey;
  cv::cvtColor(Render(scene, camera, world_from_cam, {.supersample = 4, .threads = 2}), grey, cv::COLOR_BGR2GRAY);

  apriltag_family_t* family = tag36h11_create();
  apriltag_detector_t* detector = apriltag_detector_create();
  apriltag_detector_add_family(detector, family);
  detector->quad_decimate = 1;
  image_u8_t view = {grey.cols, grey.rows, static_cast<int32_t>(grey.step), grey.data};
  zarray_t* found = apriltag_detector_detect(detector, &view);
  ASSERT_EQ(zarray_size(found), 1);
  apriltag_detection_t* detection = nullptr;
  zarray_get(found, 0, &detection);
  EXPECT_EQ(detection->id, 57);
  EXPECT_EQ(detection->hamming, 0);
  // bottom-left, bottom-right, top-right, top-left of the black square
  const double h = size / 2;
  const Vector3d corners[] = {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
  for (int i = 0; i < 4; ++i) {
    const Vector2d expected = *camera.Project(world_from_cam.Inverse() * (world_from_tag * corners[i]));
    const Vector2d seen = FromAprilTagPixel({detection->p[i][0], detection->p[i][1]});
    EXPECT_LT((seen - expected).norm(), 0.5) << i << ": " << seen.transpose() << " / " << expected.transpose();
  }
  apriltag_detections_destroy(found);
  apriltag_detector_destroy(detector);
  tag36h11_destroy(family);
  EXPECT_THROW(TagTexture(587, 4), InputError);
  EXPECT_THROW(TagTexture(-1, 4), InputError);
}

TEST(Render, FeaturesAreFoundAgainFromAnotherPlace) {
  // Two pictures of a street 1.5 m apart. A feature's place in the second follows from the scene.
  const Scene scene = DistractorScene({.width = 1024, .facades = 4, .cars = 3, .px_per_m = 48}, 8);
  const Camera camera = Camera::FromFieldOfView(800, 600, 80 * kDegToRad);
  const Rigid3d poses[] = {{WorldFromCamRotation({1.2, 0, 0}), {-0.75, 0, 1.7}},
                           {WorldFromCamRotation({1.1, 0.02, 0.01}), {0.75, 0.2, 1.7}}};
  std::vector<cv::KeyPoint> keys[2];
  cv::Mat descriptors[2];
  for (int i = 0; i < 2; ++i) {
    cv::Mat grey;
    cv::cvtColor(Render(scene, camera, poses[i], {.noise_sigma = 2, .seed = 5, .threads = 2}), grey,
                 cv::COLOR_BGR2GRAY);
    cv::SIFT::create(2000)->detectAndCompute(grey, cv::noArray(), keys[i], descriptors[i]);
    EXPECT_GT(keys[i].size(), 500u);
  }
  const auto pixel_of = [](const cv::KeyPoint& k) { return FromOpenCvSiftPixel({k.pt.x, k.pt.y}); };
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_L2, true).match(descriptors[0], descriptors[1], matches);
  std::vector<int> match_of(keys[0].size(), -1);
  for (const cv::DMatch& m : matches) match_of[m.queryIdx] = m.trainIdx;
  int visible = 0, repeated = 0, matched = 0;
  for (size_t i = 0; i < keys[0].size(); ++i) {
    const Vector3d ray = poses[0].rotation * *camera.Unproject(pixel_of(keys[0][i]));
    double distance = 0, seen = 0;
    if (FirstHit(scene, poses[0].translation, ray, &distance) < 0) continue;
    const Vector3d point = poses[0].translation + distance * ray, to = point - poses[1].translation;
    const auto expected = camera.Project(poses[1].Inverse() * point);
    if (!expected || !camera.Contains(*expected)) continue;
    FirstHit(scene, poses[1].translation, to.normalized(), &seen);
    if (seen < to.norm() - 0.05) continue;
    ++visible;
    repeated += std::any_of(keys[1].begin(), keys[1].end(),
                            [&](const cv::KeyPoint& k) { return (pixel_of(k) - *expected).norm() < 2; });
    matched += match_of[i] >= 0 && (pixel_of(keys[1][match_of[i]]) - *expected).norm() < 2;
  }
  EXPECT_GT(visible, 300);
  EXPECT_GT(repeated, 0.6 * visible) << repeated << " of " << visible;
  EXPECT_GT(matched, 0.4 * visible) << matched << " of " << visible;  // windows that repeat take their share
}

TEST(ValueNoise, HasTheSizeAskedForAndStaysInRange) {
  for (const double cell : {0.7, 1.0, 1.005, 1.3, 2.0, 7.9, 64.3, 300.0}) {
    for (const cv::Size size : {cv::Size(8, 8), cv::Size(641, 133), cv::Size(200, 977)}) {
      const cv::Mat noise = ValueNoise(size, cell, 8, 3);
      EXPECT_EQ(noise.size(), size) << cell;
      EXPECT_LT(cv::norm(noise, cv::NORM_INF), 1.3);
    }
  }
}

TEST(Distractors, DifferWithTheSeedAndRepeatWithIt) {
  const DistractorOptions options = {.width = 256, .facades = 2, .cars = 2, .px_per_m = 8};
  const cv::Mat a = MakeDistractorPanorama(options, 1, 2), b = MakeDistractorPanorama(options, 1, 1);
  const cv::Mat c = MakeDistractorPanorama(options, 2, 1);
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(a, c, cv::NORM_L1) / static_cast<double>(a.total() * 3), 10);
  EXPECT_EQ(a.size(), cv::Size(256, 128));
}

}  // namespace
}  // namespace trigpoint
