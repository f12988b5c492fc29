#include "tests/synthetic/synthetic_site.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

SyntheticOptions Small(const std::string& path) {
  SyntheticOptions options;
  options.path = path;
  options.length_m = 60;
  options.panoramas = 4;
  return options;
}

// Sums of squares of n standard normals have mean n and variance 2 n.
void ExpectChiSquare(double sum, double n, const char* what) {
  EXPECT_NEAR(sum / n, 1.0, 5 * std::sqrt(2.0 / n)) << what << ", n = " << n;
}

class SyntheticSiteTest : public testing::TestWithParam<const char*> {};

TEST_P(SyntheticSiteTest, TruthProjectsOntoObservationsWithoutNoise) {
  SyntheticOptions options = Small(GetParam());
  options.pixel_sigma_px = options.view_pixel_sigma_px = 0;
  options.odometry_rotation_sigma_rad = options.odometry_rotation_sigma_per_m = 0;
  options.odometry_translation_sigma_m = options.odometry_translation_sigma_per_m = 0;
  options.odometry_scale_sigma = 0;
  options.geotag_sigma_h_m = options.geotag_sigma_v_m = 0;
  options.geotag_sigma_heading_deg = options.geotag_sigma_tilt_deg = 0;
  const SyntheticSite site = MakeSyntheticSite(options, 3);
  ASSERT_EQ(site.images.size(), site.truth.world_from_body.size());
  ASSERT_GT(site.images.size(), 100u);
  for (const SyntheticImage& image : site.images) {
    EXPECT_GT(image.observations.size(), 40u);
    const Rigid3d cam_from_world = site.WorldFromCam(image).Inverse();
    for (const SyntheticObservation& o : image.observations) {
      const Eigen::Vector3d p = cam_from_world * site.truth.points[o.point];
      EXPECT_GT(p.norm(), options.min_depth_m);
      EXPECT_LT(p.norm(), options.max_depth_m);
      EXPECT_LT((*site.cameras[0].camera.Project(p) - o.pixel).norm(), 1e-9);
    }
  }
  for (size_t i = 0; i < site.panoramas.size(); ++i) {
    const SyntheticPanorama& panorama = site.panoramas[i];
    EXPECT_GT(panorama.observations.size(), 60u);
    const Rigid3d pano_from_world = site.truth.world_from_pano[i].Inverse();
    for (const SyntheticViewObservation& o : panorama.observations) {
      const View& view = panorama.rig.views[o.view];
      const Eigen::Vector3d p = view.rig_from_view.Inverse() * (pano_from_world * site.truth.points[o.point]);
      EXPECT_LT((*view.camera.Project(p) - o.pixel).norm(), 1e-9);
    }
    const Eigen::Vector3d geotag = site.frame.EnuFromGeodetic(panorama.geotag.position);
    EXPECT_LT((geotag - site.truth.world_from_pano[i].translation).norm(), 1e-6);
    EXPECT_LT(AngleBetween(WorldFromCamRotation(panorama.geotag.attitude), site.truth.world_from_pano[i].rotation),
              1e-9);
  }
  // The odometry's frame is the first body pose.
  for (size_t i = 0; i < site.odometry.poses.size(); ++i) {
    const Rigid3d world_from_body = site.truth.world_from_body[0] * site.odometry.poses[i].target_from_body;
    EXPECT_LT(world_from_body.Minus(site.truth.world_from_body[i]).norm(), 1e-9);
  }
}

TEST_P(SyntheticSiteTest, RedrawsHaveTheStatedStatistics) {
  SyntheticOptions options = Small(GetParam());
  const SyntheticSite first = MakeSyntheticSite(options, 5);
  double pixels = 0, pixel_sum = 0, steps = 0, rotation_sum = 0, translation_sum = 0, scale_sum = 0, tags = 0,
         position_sum = 0, height_sum = 0, heading_sum = 0, tilt_sum = 0, view_pixels = 0, view_sum = 0, fixes = 0,
         gps_sum = 0;
  const int redraws = 60;
  for (int redraw = 0; redraw < redraws; ++redraw) {
    const SyntheticSite site = RedrawNoise(first, 1000 + redraw);
    for (const SyntheticImage& image : site.images) {
      const Rigid3d cam_from_world = site.WorldFromCam(image).Inverse();
      for (const SyntheticObservation& o : image.observations) {
        const Eigen::Vector2d p = *site.cameras[0].camera.Project(cam_from_world * site.truth.points[o.point]);
        pixel_sum += (o.pixel - p).squaredNorm() / (options.pixel_sigma_px * options.pixel_sigma_px);
        pixels += 2;
      }
    }
    scale_sum += std::pow((site.truth.odometry_scale - 1) / options.odometry_scale_sigma, 2);
    for (size_t i = 0; i + 1 < site.odometry.poses.size(); ++i) {
      Rigid3d truth = site.truth.world_from_body[i].Inverse() * site.truth.world_from_body[i + 1];
      const Vector6d sigma = OdometrySigma(options, truth.translation.norm());
      truth.translation *= site.truth.odometry_scale;
      const Rigid3d observed =
          site.odometry.poses[i].target_from_body.Inverse() * site.odometry.poses[i + 1].target_from_body;
      const Vector6d z = observed.Minus(truth).cwiseQuotient(sigma);
      rotation_sum += z.head<3>().squaredNorm();
      translation_sum += z.tail<3>().squaredNorm();
      steps += 3;
    }
    for (size_t i = 0; i < site.panoramas.size(); ++i) {
      const GeoTag& tag = site.panoramas[i].geotag;
      const Rigid3d& truth = site.truth.world_from_pano[i];
      const Eigen::Vector3d d = site.frame.EnuFromGeodetic(tag.position) - truth.translation;
      position_sum += d.head<2>().squaredNorm() / (tag.sigma_h_m * tag.sigma_h_m);
      height_sum += d.z() * d.z() / (tag.sigma_v_m * tag.sigma_v_m);
      const Attitude a = AttitudeOf(truth.rotation);
      heading_sum += std::pow(WrapAngle(tag.attitude.heading_rad - a.heading_rad) / tag.sigma_heading_rad, 2);
      tilt_sum += std::pow((tag.attitude.pitch_rad - a.pitch_rad) / tag.sigma_tilt_rad, 2) +
                  std::pow((tag.attitude.roll_rad - a.roll_rad) / tag.sigma_tilt_rad, 2);
      tags += 1;
      for (const SyntheticViewObservation& o : site.panoramas[i].observations) {
        const View& view = site.panoramas[i].rig.views[o.view];
        const Eigen::Vector3d p = view.rig_from_view.Inverse() * (truth.Inverse() * site.truth.points[o.point]);
        view_sum += (*view.camera.Project(p) - o.pixel).squaredNorm() / std::pow(options.view_pixel_sigma_px, 2);
        view_pixels += 2;
      }
    }
    for (const GpsFix& fix : site.gps) {
      const size_t i = static_cast<size_t>(std::lround(static_cast<double>(fix.stamp_ns) * 1e-9 / options.step_s));
      const Eigen::Vector3d d = site.frame.EnuFromGeodetic(fix.position) - site.truth.world_from_body[i].translation;
      gps_sum +=
          d.head<2>().squaredNorm() / (fix.sigma_h_m * fix.sigma_h_m) + d.z() * d.z() / (fix.sigma_v_m * fix.sigma_v_m);
      fixes += 3;
    }
  }
  ExpectChiSquare(pixel_sum, pixels, "image observations");
  ExpectChiSquare(rotation_sum, steps, "odometry rotation");
  ExpectChiSquare(translation_sum, steps, "odometry translation");
  ExpectChiSquare(scale_sum, redraws, "odometry scale");
  ExpectChiSquare(view_sum, view_pixels, "view observations");
  ExpectChiSquare(position_sum, 2 * tags, "geotag position");
  ExpectChiSquare(height_sum, tags, "geotag height");
  ExpectChiSquare(heading_sum, tags, "geotag heading");
  ExpectChiSquare(tilt_sum, 2 * tags, "geotag pitch and roll");
  ExpectChiSquare(gps_sum, fixes, "GPS");
}

TEST_P(SyntheticSiteTest, TracksRunOverConsecutiveImages) {
  const SyntheticSite site = MakeSyntheticSite(Small(GetParam()), 7);
  std::vector<int> first(site.truth.points.size(), -1), last(site.truth.points.size(), -1),
      count(site.truth.points.size(), 0);
  for (size_t i = 0; i < site.images.size(); ++i) {
    EXPECT_TRUE(std::is_sorted(site.images[i].observations.begin(), site.images[i].observations.end(),
                               [](const auto& a, const auto& b) { return a.point < b.point; }));
    for (const SyntheticObservation& o : site.images[i].observations) {
      if (first[o.point] < 0) first[o.point] = static_cast<int>(i);
      last[o.point] = static_cast<int>(i);
      ++count[o.point];
    }
  }
  for (size_t p = 0; p < count.size(); ++p) {
    EXPECT_GE(count[p], site.options.min_track_length);
    EXPECT_EQ(count[p], last[p] - first[p] + 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Paths, SyntheticSiteTest, testing::Values("loop", "street"));

TEST(SyntheticSite, TheSameSeedGivesTheSameSiteAndAnotherKeepsTheGeometry) {
  const SyntheticSite a = MakeSyntheticSite(Small("loop"), 9), b = MakeSyntheticSite(Small("loop"), 9);
  const SyntheticSite c = RedrawNoise(a, 10);
  ASSERT_EQ(a.images.size(), c.images.size());
  for (size_t i = 0; i < a.images.size(); ++i) {
    ASSERT_EQ(a.images[i].observations.size(), c.images[i].observations.size());
    for (size_t k = 0; k < a.images[i].observations.size(); ++k) {
      EXPECT_EQ(a.images[i].observations[k].pixel, b.images[i].observations[k].pixel);
      EXPECT_EQ(a.images[i].observations[k].point, c.images[i].observations[k].point);
      EXPECT_NE(a.images[i].observations[k].pixel, c.images[i].observations[k].pixel);
    }
  }
  EXPECT_EQ(a.truth.points, c.truth.points);
  EXPECT_NE(a.truth.odometry_scale, c.truth.odometry_scale);
}

TEST(SyntheticSite, OutliersAreWhereTheTruthSaysAndAsManyAsAsked) {
  SyntheticOptions options = Small("loop");
  options.geotag_outliers = 1;
  options.outlier_fraction = 0.1;
  options.alias_fraction = 0.3;
  const SyntheticSite site = MakeSyntheticSite(options, 11);
  int outliers = 0, wrong = 0, total = 0, aliased = 0;
  for (size_t i = 0; i < site.panoramas.size(); ++i) {
    const double d =
        (site.frame.EnuFromGeodetic(site.panoramas[i].geotag.position) - site.truth.world_from_pano[i].translation)
            .head<2>()
            .norm();
    EXPECT_EQ(d > 4, site.truth.geotag_is_outlier[i]) << d;
    outliers += site.truth.geotag_is_outlier[i];
    const auto& flags = site.truth.aliased[i];
    aliased += static_cast<int>(std::count(flags.begin(), flags.end(), true));
    for (size_t k = 0; k < flags.size(); ++k) {
      const SyntheticViewObservation& o = site.panoramas[i].observations[k];
      const View& view = site.panoramas[i].rig.views[o.view];
      const Eigen::Vector3d p =
          site.truth.points[o.point] + (flags[k] ? options.alias_shift_m : 0) * site.truth.along[o.point];
      const auto pixel =
          view.camera.Project(view.rig_from_view.Inverse() * (site.truth.world_from_pano[i].Inverse() * p));
      EXPECT_LT((*pixel - o.pixel).norm(), 6 * options.view_pixel_sigma_px);
    }
  }
  EXPECT_EQ(outliers, 1);
  EXPECT_GT(aliased, 20);
  for (const std::vector<bool>& flags : site.truth.wrong) {
    wrong += static_cast<int>(std::count(flags.begin(), flags.end(), true));
    total += static_cast<int>(flags.size());
  }
  EXPECT_NEAR(static_cast<double>(wrong) / total, 0.1, 0.01);
}

TEST(SyntheticSite, SeveralCamerasShareTheBody) {
  const SyntheticSite site =
      MakeSyntheticSite(Small("street"), 2, {SyntheticCamera("left", 0.8), SyntheticCamera("right", -0.8)});
  ASSERT_EQ(site.images.size(), 2 * site.truth.world_from_body.size());
  EXPECT_EQ(site.images[0].stamp_ns, site.images[1].stamp_ns);
  // The right camera looks to the right of the body.
  const Eigen::Vector3d forward = site.cameras[1].cam_from_body.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_LT(forward.y(), -0.5);
  EXPECT_GT(forward.x(), 0.5);
}

TEST(SyntheticSite, NamesEveryBadOption) {
  SyntheticOptions options;
  options.path = "circle";
  options.step_m = -1;
  try {
    MakeSyntheticSite(options, 1);
    FAIL();
  } catch (const OptionError& e) {
    EXPECT_NE(std::string(e.what()).find("circle"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("step_m"), std::string::npos);
  }
}

}  // namespace
}  // namespace trigpoint
