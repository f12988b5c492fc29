// The prepared sites beside the source tree are read completely: counts and a few values by hand.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>

#include "datasets/io/exif.h"
#include "datasets/io/gps.h"
#include "datasets/io/image.h"
#include "datasets/io/site.h"
#include "datasets/io/tables.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

std::filesystem::path SharedData() {
  const char* named = std::getenv("TRIGPOINT_SHARED_DATA");
  return named != nullptr ? std::filesystem::path(named) : std::filesystem::path("../shared/data");
}

std::optional<Site> Read(const std::string& name) {
  const std::filesystem::path dir = SharedData() / name;
  if (!std::filesystem::is_directory(dir)) return std::nullopt;
  return ReadSite(dir);
}

TEST(SharedSites, LotA) {
  const auto site = Read("lot_a");
  if (!site) GTEST_SKIP() << "no shared data";
  EXPECT_EQ(Joined(site->warnings), "");
  ASSERT_EQ(site->runs.size(), 2u);
  const trigpoint::Run& run1 = site->runs[0];
  const trigpoint::Run& run3 = site->runs[1];
  EXPECT_EQ(run1.name, "run1");
  EXPECT_EQ(Joined(run1.warnings), "");
  EXPECT_EQ(Joined(run3.warnings), "");
  EXPECT_EQ(run1.images.size(), 258u);
  EXPECT_EQ(run3.images.size(), 124u);
  EXPECT_EQ(run1.odometry.poses.size(), 258u);
  EXPECT_EQ(run1.gps.size(), 129u);
  EXPECT_EQ(run3.gps.size(), 62u);
  // GGA: 10:00:00 UTC is 1000 s after time zero; 190.1 m above the sea + 47.8 m.
  EXPECT_EQ(run3.gps.front().stamp_ns, 1000'000'000'000);
  EXPECT_NEAR(run3.gps.front().position.height_m, 237.9, 1e-9);
  EXPECT_NEAR(run3.gps.front().position.latitude_deg, 48 + 0.7459712 / 60, 1e-12);
  EXPECT_EQ(run1.config.gps_lever_arm_m, Eigen::Vector3d(0, 0, 1.3));
  EXPECT_TRUE(run1.cameras.at(0).has_extrinsics);
  EXPECT_NEAR(run1.cameras[0].cam_from_body.translation.y(), 1.1, 1e-12);
  ASSERT_EQ(site->references.size(), 11u);
  EXPECT_EQ(site->references[0].name, "panoramas/pano_057.jpg");
  EXPECT_EQ(site->references[0].station, "S57");
  EXPECT_TRUE(site->references[0].geotag.has_tilt);
  EXPECT_NEAR(site->references[0].geotag.attitude.heading_rad, 195.14 * kDegToRad, 1e-12);
  EXPECT_NEAR(site->references[0].geotag.sigma_tilt_rad, 0.3 * kDegToRad, 1e-12);
  EXPECT_EQ(site->references[9].kind, ReferenceKind::kPhotoSet);
  EXPECT_EQ(site->references[9].name, "station_099");
  EXPECT_EQ(site->references[9].files.size(), 24u);
  ASSERT_TRUE(site->references[9].camera.has_value());
  EXPECT_EQ(site->stations.size(), 9u);
  EXPECT_EQ(site->control_points.size(), 6u);
  EXPECT_TRUE(site->control_points[0].control);
  EXPECT_EQ(site->tags.size_m, 0.5);
  EXPECT_FALSE(site->aerial.empty());
  EXPECT_EQ(site->origin->height_m, 240);
  const cv::Mat grey = LoadGrey(run1, run1.images[7]);
  EXPECT_EQ(grey.cols, 960);
  EXPECT_EQ(grey.channels(), 1);
}

TEST(SharedSites, LotAIsReadQuickly) {
  if (!Read("lot_a")) GTEST_SKIP() << "no shared data";
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(Read("lot_a"));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  RecordProperty("seconds", std::to_string(taken.count()));
  EXPECT_LT(taken.count(), 0.2);
}

TEST(SharedSites, Heidelberg) {
  const auto site = Read("heidelberg");
  if (!site) GTEST_SKIP() << "no shared data";
  ASSERT_EQ(site->runs.size(), 2u);
  EXPECT_EQ(Joined(site->runs[0].warnings) + Joined(site->runs[1].warnings) + Joined(site->warnings), "");
  EXPECT_EQ(site->runs[0].name, "back");
  EXPECT_EQ(site->runs[0].images.size(), 7u);
  EXPECT_EQ(site->references.size(), 3u);
  EXPECT_EQ(LoadPanorama(site->references[0].files[0], true).cols, 2560);
}

TEST(SharedSites, Kitti) {
  const auto site = Read("kitti_00");
  if (!site) GTEST_SKIP() << "no shared data";
  ASSERT_EQ(site->runs.size(), 1u);
  EXPECT_EQ(Joined(site->runs[0].warnings) + Joined(site->warnings), "");
  EXPECT_EQ(site->runs[0].images.size(), 136u);
  EXPECT_EQ(site->runs[0].images[1].stamp_ns, 100'103'736'000);
  ASSERT_FALSE(site->references.empty());
  EXPECT_EQ(site->references[0].kind, ReferenceKind::kPhoto);
  EXPECT_EQ(site->references[0].camera->width(), 1241);
}

TEST(SharedSites, Strecha) {
  const auto fountain = Read("strecha/fountain_P11"), herz_jesu = Read("strecha/herz_jesu_P8");
  if (!fountain || !herz_jesu) GTEST_SKIP() << "no shared data";
  EXPECT_EQ(fountain->references.size(), 2u);
  EXPECT_EQ(fountain->runs.at(0).images.size(), 9u);
  EXPECT_EQ(herz_jesu->runs.at(0).images.size(), 8u);
  EXPECT_FALSE(herz_jesu->origin.has_value());
  EXPECT_EQ(Joined(fountain->warnings) + Joined(herz_jesu->warnings), "");
}

// The example that is part of the program.
TEST(ParkingLot, IsReadCompletely) {
  const Site site = ReadSite("datasets/parking_lot");
  std::string warnings = Joined(site.warnings);
  size_t images = 0;
  for (const trigpoint::Run& run : site.runs) {
    warnings += Joined(run.warnings);
    images += run.images.size();
    EXPECT_FALSE(run.odometry.poses.empty());
    EXPECT_FALSE(run.gps.empty());
    EXPECT_EQ(LoadGrey(run, run.images.back()).cols, run.cameras[0].camera.width());
  }
  EXPECT_EQ(warnings, "");
  EXPECT_GT(images, 30u);
  EXPECT_GE(site.references.size(), 4u);
  EXPECT_FALSE(site.stations.empty() || site.control_points.empty() || site.aerial.empty());
}

// What the table says stands in the files too, to the digits written there.
TEST(SharedSites, LotAPanoramasSayTheSameThemselves) {
  const auto site = Read("lot_a");
  if (!site) GTEST_SKIP() << "no shared data";
  std::vector<std::string> warnings;
  const auto files = ReadPanoramaFolder(site->dir / "panoramas", site->dir, &warnings);
  EXPECT_EQ(Joined(warnings), "");
  ASSERT_EQ(files.size(), 9u);
  for (const Reference& file : files) {
    const auto row = std::find_if(site->references.begin(), site->references.end(),
                                  [&](const Reference& reference) { return reference.name == file.name; });
    ASSERT_NE(row, site->references.end()) << file.name;
    EXPECT_NEAR(file.geotag.position.latitude_deg, row->geotag.position.latitude_deg, 2e-8);
    EXPECT_NEAR(file.geotag.position.longitude_deg, row->geotag.position.longitude_deg, 2e-8);
    EXPECT_NEAR(file.geotag.position.height_m, row->geotag.position.height_m, 0.01);
    EXPECT_NEAR(file.geotag.attitude.heading_rad, row->geotag.attitude.heading_rad, 1e-9);
    EXPECT_NEAR(file.geotag.attitude.pitch_rad, row->geotag.attitude.pitch_rad, 1e-9);
    EXPECT_NEAR(file.geotag.attitude.roll_rad, row->geotag.attitude.roll_rad, 1e-9);
    EXPECT_TRUE(file.geotag.has_height && file.geotag.has_heading && file.geotag.has_tilt);
  }
}

TEST(SharedSites, LotAPhotoFocalLength) {
  const auto site = Read("lot_a");
  if (!site) GTEST_SKIP() << "no shared data";
  EXPECT_NEAR(site->references[9].camera->params()[0], 1331.4, 5);
}

TEST(SharedData, PhonePhotos) {
  const std::filesystem::path dir = SharedData() / "lund/images";
  if (!std::filesystem::is_directory(dir)) GTEST_SKIP() << "no shared data";
  const LocalFrame street({55.6985, 13.1950, 40});
  size_t near = 0;
  for (const auto& file : PicturesIn(dir)) {
    const PhotoMetadata metadata = ReadPhotoMetadata(file);
    near += metadata.position && street.EnuFromGeodetic(*metadata.position).norm() < 300;
    EXPECT_NEAR(metadata.focal_px.value_or(0), 996, 1);
  }
  EXPECT_EQ(near, 29u);
}

TEST(SharedData, TrajectoriesOfOthers) {
  const std::filesystem::path dir = SharedData() / "trajectories";
  if (!std::filesystem::is_directory(dir)) GTEST_SKIP() << "no shared data";
  EXPECT_EQ(ReadKittiTrajectory(dir / "KITTI_00_gt.txt", dir / "KITTI_00_gt_times.txt").poses.size(), 4541u);
  const Trajectory vicon = ReadTrajectory(dir / "V102_groundtruth.csv");
  const Trajectory estimate = ReadTrajectory(dir / "V102.txt");
  EXPECT_GT(vicon.poses.size(), 10000u);
  EXPECT_EQ(vicon.poses.front().stamp_ns, 1'403'715'524'907'143'168);
  // Both on the same clock, each read in its own form.
  EXPECT_LT(std::abs(vicon.poses.front().stamp_ns - estimate.poses.front().stamp_ns), 20'000'000'000);
  EXPECT_GT(ReadTrajectory(dir / "freiburg1_xyz-groundtruth.txt").poses.size(), 2900u);
}

TEST(SharedData, GpxTracks) {
  const std::filesystem::path file = SharedData() / "geodesy/test_files/around-visnjan-with-car.gpx";
  if (!std::filesystem::is_regular_file(file)) GTEST_SKIP() << "no shared data";
  const GpsTrack track = ReadGpx(file, {});
  EXPECT_GT(track.fixes.size(), 100u);
  const LocalFrame visnjan({45.2775, 13.7206, 250});
  for (const GpsFix& fix : track.fixes) EXPECT_LT(visnjan.EnuFromGeodetic(fix.position).head<2>().norm(), 30e3);
}

}  // namespace
}  // namespace trigpoint
