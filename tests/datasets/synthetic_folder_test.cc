// Written sites, read back by datasets/io, and the inputs made from them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "tests/support/temp_dir.h"
#include "tests/synthetic/rendered_site.h"
#include "tests/synthetic/site_writer.h"
#include "tests/synthetic/street_view.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

BodyCamera SmallCamera(const std::string& name, double yaw) {
  BodyCamera camera = SyntheticCamera(name, yaw);
  camera.camera = Camera(CameraModel::kRadtan, 240, 160, {130, 131, 119, 80, -0.1, 0.02, 1e-3, 2e-3});
  return camera;
}

SyntheticSite SmallSite(int panoramas) {
  SyntheticOptions options;
  options.length_m = 30;
  options.step_m = 3;
  options.panoramas = panoramas;
  return MakeSyntheticSite(options, 3, {SmallCamera("cam0", 0.8), SmallCamera("cam1", -0.8)});
}

RenderedSiteOptions Cheap() {
  RenderedSiteOptions options;
  options.px_per_m = 16;
  options.panorama_width = 512;
  options.noise_sigma = 0;
  options.blur_sigma_px = 0;
  return options;
}

TEST(SyntheticFolder, WhatIsWrittenIsReadBack) {
  const TempDir folder("trigpoint synthetic ");
  const SyntheticSite synthetic = SmallSite(4);
  ProgressSink progress;
  WriteRenderedSite(synthetic, Cheap(), 1, folder / "lot", folder / "lot_truth", 2, progress, {});
  const Site site = ReadSite(folder / "lot");
  EXPECT_THAT(site.warnings, testing::IsEmpty());
  ASSERT_EQ(site.runs.size(), 1u);
  const trigpoint::Run& run = site.runs[0];
  EXPECT_EQ(run.name, "run1");
  EXPECT_THAT(run.warnings, testing::IsEmpty());
  EXPECT_FALSE(run.config.odometry_levelled);
  ASSERT_EQ(run.cameras.size(), 2u);
  for (int c = 0; c < 2; ++c) {
    EXPECT_EQ(run.cameras[c].camera.params().size(), synthetic.cameras[c].camera.params().size());
    for (size_t k = 0; k < run.cameras[c].camera.params().size(); ++k) {
      EXPECT_NEAR(run.cameras[c].camera.params()[k], synthetic.cameras[c].camera.params()[k], 1e-8);
    }
    EXPECT_LT(run.cameras[c].cam_from_body.Minus(synthetic.cameras[c].cam_from_body).norm(), 1e-9);
  }
  ASSERT_EQ(run.images.size(), synthetic.images.size());
  for (size_t i = 0; i < run.images.size(); ++i) {
    EXPECT_EQ(run.images[i].stamp_ns, synthetic.images[i].stamp_ns);
    EXPECT_EQ(run.images[i].camera, synthetic.images[i].camera);
  }
  EXPECT_EQ(LoadGrey(run, run.images[1]).size(), cv::Size(240, 160));
  ASSERT_EQ(run.odometry.poses.size(), synthetic.odometry.poses.size());
  for (size_t i = 0; i < run.odometry.poses.size(); ++i) {
    EXPECT_EQ(run.odometry.poses[i].stamp_ns, synthetic.odometry.poses[i].stamp_ns);
    EXPECT_LT(run.odometry.poses[i].target_from_body.Minus(synthetic.odometry.poses[i].target_from_body).norm(), 1e-7);
  }
  ASSERT_EQ(run.gps.size(), synthetic.gps.size());
  ASSERT_TRUE(site.origin.has_value());
  const LocalFrame frame(*site.origin);
  ASSERT_EQ(site.references.size(), synthetic.panoramas.size());
  for (size_t i = 0; i < site.references.size(); ++i) {
    const GeoTag &read = site.references[i].geotag, &made = synthetic.panoramas[i].geotag;
    EXPECT_EQ(site.references[i].kind, ReferenceKind::kPanorama);
    EXPECT_TRUE(read.has_position && read.has_height && read.has_heading && read.has_tilt);
    EXPECT_LT((frame.EnuFromGeodetic(read.position) - frame.EnuFromGeodetic(made.position)).norm(), 2e-3);
    EXPECT_NEAR(WrapAngle(read.attitude.heading_rad - made.attitude.heading_rad), 0, 2e-5);
    EXPECT_NEAR(read.attitude.pitch_rad, made.attitude.pitch_rad, 2e-5);
    EXPECT_NEAR(read.sigma_tilt_rad, made.sigma_tilt_rad, 1e-6);
    EXPECT_NEAR(read.sigma_h_m, made.sigma_h_m, 1e-9);
  }
  EXPECT_EQ(site.stations.size(), 4u);
  EXPECT_EQ(site.control_points.size(), 4u);
  EXPECT_NEAR(site.tags.size_m, 0.5, 1e-12);
}

TEST(SyntheticFolder, AStreetViewPanoramaIsTheSceneSeenFromItsNewPose) {
  const TempDir folder("trigpoint synthetic ");
  const SyntheticSite synthetic = SmallSite(2);
  const RenderedSiteOptions cheap = Cheap();
  ProgressSink progress;
  WriteRenderedSite(synthetic, cheap, 1, folder / "lot", folder / "lot_truth", 2, progress, {});
  StreetViewOptions options;
  MakeStreetViewSite(folder / "lot", folder / "lot_truth", folder / "street", folder / "street_truth", options, 5,
                     progress, {});
  const Site site = ReadSite(folder / "street");
  EXPECT_THAT(site.warnings, testing::IsEmpty());
  ASSERT_EQ(site.runs.size(), 1u);
  ASSERT_EQ(site.references.size(), 2u);
  const Trajectory truth = ReadTrajectory(folder / "street_truth/panoramas.tum");
  const Scene scene = MakeScene(synthetic, cheap, 1);
  for (int i = 0; i < 2; ++i) {
    const Rigid3d& pose = truth.poses[i].target_from_body;
    EXPECT_LT((pose.translation - synthetic.truth.world_from_pano[i].translation).norm(), 1e-5);
    const Attitude attitude = AttitudeOf(pose.rotation);
    EXPECT_NEAR(attitude.roll_rad, 0, 1e-7);
    EXPECT_LT(std::abs(attitude.pitch_rad), 3.5 * kDegToRad);
    const GeoTag& tag = site.references[i].geotag;
    EXPECT_FALSE(tag.has_height);
    EXPECT_EQ(tag.attitude.pitch_rad, 0);
    EXPECT_NEAR(WrapAngle(tag.attitude.heading_rad - attitude.heading_rad), 0, 5 * 0.3 * kDegToRad);

    const cv::Mat picture = LoadPicture(site.references[i].files.front(), false);
    const cv::Mat expected = Render(scene, Camera::Equirectangular(512, 256), pose, {.supersample = 2, .threads = 2});
    const cv::Rect above(0, 0, 512, static_cast<int>((0.5 + 30.0 / 180) * 256));
    const double same = cv::norm(picture(above), expected(above), cv::NORM_L1) / (3.0 * above.area());
    const cv::Mat level =
        Render(scene, Camera::Equirectangular(512, 256), synthetic.truth.world_from_pano[i], {.threads = 2});
    const double turned = cv::norm(picture(above), level(above), cv::NORM_L1) / (3.0 * above.area());
    EXPECT_LT(same, 4);
    EXPECT_GT(turned, 1.5 * same);
    // The hidden part is black in one, the roof in the other.
    const cv::Scalar bottom = cv::mean(picture.rowRange(230, 256));
    if (i == 0) {
      EXPECT_LT(bottom[0], 3);
    } else {
      EXPECT_GT(bottom[0], 100);
    }
  }
}

TEST(SyntheticFolder, StreetViewGeotagsAreAsFarOffAsStated) {
  const TempDir folder("trigpoint synthetic ");
  const SyntheticSite synthetic = SmallSite(200);
  RenderedSiteOptions cheap = Cheap();
  cheap.panorama_width = 64;
  cheap.tags = false;
  ProgressSink progress;
  WriteRenderedSite(synthetic, cheap, 1, folder / "lot", folder / "lot_truth", 2, progress, {});
  StreetViewOptions options;
  options.outliers = 3;
  MakeStreetViewSite(folder / "lot", folder / "lot_truth", folder / "street", folder / "street_truth", options, 5,
                     progress, {});
  const Site site = ReadSite(folder / "street");
  const LocalFrame frame(*site.origin);
  std::vector<double> errors;
  double heading2 = 0;
  for (const Reference& reference : site.references) {
    const int number = std::stoi(reference.station.substr(1));
    const Rigid3d& truth = synthetic.truth.world_from_pano[number];
    errors.push_back((frame.EnuFromGeodetic(reference.geotag.position) - truth.translation).head<2>().norm());
    heading2 += std::pow(
        WrapAngle(reference.geotag.attitude.heading_rad - AttitudeOf(truth.rotation).heading_rad) * kRadToDeg, 2);
  }
  std::sort(errors.begin(), errors.end());
  ASSERT_EQ(errors.size(), 200u);
  EXPECT_NEAR(errors[199], 7, 0.02);
  EXPECT_NEAR(errors[100], 0.35, 0.09);
  EXPECT_NEAR(errors[180], 1.2, 0.4);
  EXPECT_NEAR(std::sqrt(heading2 / 200), 0.3, 0.06);
}

TEST(SyntheticFolder, AMirroredRunLoadsAsTheOriginal) {
  const TempDir folder("trigpoint synthetic ");
  const SyntheticSite synthetic = SmallSite(0);
  ProgressSink progress;
  WriteRenderedSite(synthetic, Cheap(), 1, folder / "lot", folder / "lot_truth", 2, progress, {});
  MakeMirroredSite(folder / "lot", "run1", folder / "mirrored", progress, {});
  const trigpoint::Run run = ReadRun(folder / "lot/runs/run1", folder / "lot");
  const trigpoint::Run mirrored = ReadRun(folder / "mirrored/runs/run1", folder / "mirrored");
  EXPECT_TRUE(mirrored.config.mirrored);
  EXPECT_FALSE(run.config.mirrored);
  const cv::Mat a = LoadGrey(run, run.images[4]), b = LoadGrey(mirrored, mirrored.images[4]);
  cv::Mat flipped;
  cv::flip(b, flipped, 1);
  const double n = static_cast<double>(a.total());
  EXPECT_LT(cv::norm(a, b, cv::NORM_L1) / n, 3);
  EXPECT_GT(cv::norm(a, flipped, cv::NORM_L1) / n, 10);
  EXPECT_THROW(MakeMirroredSite(folder / "mirrored", "run1", folder / "again", progress, {}), InputError);
}

TEST(SyntheticFolder, SaysWhatIsMissing) {
  const TempDir folder("trigpoint synthetic ");
  WriteText(folder / "lot/origin.json", "{\"lat\": 48, \"lon\": 8, \"alt\": 300}");
  WriteText(folder / "lot_truth/readme.txt", "nothing");
  ProgressSink progress;
  try {
    MakeStreetViewSite(folder / "lot", folder / "lot_truth", folder / "s", folder / "t", {}, 1, progress, {});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("panoramas.tum"), std::string::npos) << e.what();
  }
}

TEST(SyntheticFolder, RotatingAPanoramaBackGivesTheFirst) {
  cv::Mat noise(128, 256, CV_8UC3);
  cv::randu(noise, 0, 255);
  cv::GaussianBlur(noise, noise, {}, 3);
  const Eigen::Quaterniond turn = ExpSO3({0.1, 0.7, -0.05});
  const cv::Mat back = RotatePanorama(RotatePanorama(noise, turn), turn.conjugate());
  const cv::Rect middle(0, 32, 256, 64);  // the seam included, the poles not
  EXPECT_LT(cv::norm(noise(middle), back(middle), cv::NORM_L1) / (3.0 * middle.area()), 2);
}

}  // namespace
}  // namespace trigpoint
