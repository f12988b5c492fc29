// Offsets of stations from tags that a panorama shows, on made sights of known noise.
#include "survey/tags/station_offset.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "calib/estimation/random.h"

namespace trigpoint {
namespace {

constexpr double kSize = 0.5, kNoisePx = 0.2, kTagM = 0.003, kTagRad = 0.002;

// A panorama at (1, 2, 1.9) that looks north, its own tag 7 to the north-east and below, two others farther off.
struct Scene {
  Scene(uint64_t seed, const Eigen::Vector3d& stated_error = Eigen::Vector3d::Zero()) : random(seed) {
    // z of the panorama and of an upright tag to the south of it: north; x east, y down.
    const Eigen::Quaterniond north(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX()));
    world_from_pano = Rigid3d(north, {1, 2, 1.9});
    const Eigen::Vector3d places[3] = {{1.8, 4.5, 1.1}, {-3, 9, 1.5}, {6, 8, 2.0}};
    for (int k = 0; k < 3; ++k) {
      const Rigid3d tag(Eigen::AngleAxisd(0.3 * (1 - k), Eigen::Vector3d::UnitZ()) * north, places[k]);
      tags.push_back(tag);
      Vector6d error;
      for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? kTagRad : kTagM) * random.Normal();
      TagEstimate estimate;
      estimate.tag_id = 7 + k;
      estimate.size_m = kSize;
      estimate.status = "ok";
      estimate.world_from_tag = tag.Plus(error);
      estimate.covariance.diagonal() << Eigen::Vector3d::Constant(kTagRad * kTagRad),
          Eigen::Vector3d::Constant(kTagM * kTagM);
      map.push_back(estimate);
    }
    station.name = "S7";
    station.tag_id = 7;
    station.offset_m = world_from_pano.translation - tags[0].translation + stated_error;
    station.sigma_m = 0.01;
  }

  // Sights in two overlapping views.
  std::vector<PanoramaTag> See(int first, int last) {
    std::vector<PanoramaTag> seen;
    for (const double turn : {0.0, 0.5}) {
      const Rigid3d pano_from_view(Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY())),
                                   Eigen::Vector3d::Zero());
      for (int k = first; k < last; ++k) {
        PanoramaTag s;
        s.camera = &camera;
        s.pano_from_view = pano_from_view;
        s.detection.id = 7 + k;
        bool inside = true;
        for (int c = 0; c < 4; ++c) {
          const auto pixel =
              camera.Project(pano_from_view.Inverse() * (world_from_pano.Inverse() * (tags[k] * TagCorner(kSize, c))));
          inside = inside && pixel.has_value();
          if (!pixel) break;
          s.detection.corners[static_cast<size_t>(c)] =
              *pixel + kNoisePx * Eigen::Vector2d(random.Normal(), random.Normal());
          s.detection.corner_sigma_px[static_cast<size_t>(c)] = kNoisePx;
        }
        if (inside) seen.push_back(s);
      }
    }
    return seen;
  }

  Random random;
  Camera camera = Camera::FromFieldOfView(1300, 1300, M_PI / 2);
  Rigid3d world_from_pano;
  std::vector<Rigid3d> tags;
  std::vector<TagEstimate> map;
  Station station;
};

TagPosesOptions Exact() {
  TagPosesOptions options;
  options.extra_sigma_px = 0;
  return options;
}

TEST(StationOffset, CovarianceIsReal) {
  double nees = 0;
  const int redraws = 60;
  for (int seed = 1; seed <= redraws; ++seed) {
    Scene scene(static_cast<uint64_t>(seed));
    const StationOffset o = EstimateStationOffset(scene.station, "p.jpg", scene.See(0, 3), scene.map, Exact());
    ASSERT_TRUE(o.offset_m) << o.reason;
    EXPECT_TRUE(o.own_tag);
    EXPECT_EQ(o.tags, 3);
    EXPECT_FALSE(o.Contradicts());
    const Eigen::Vector3d e = *o.offset_m - scene.station.offset_m;
    EXPECT_LT(e.norm(), 0.06);
    nees += e.dot(o.covariance.inverse() * e);
    EXPECT_LT(o.combined.trace(), 3 * 0.01 * 0.01);
  }
  // Chi-square with 180 degrees of freedom, 99.9 %: 125 to 245.
  EXPECT_GT(nees, 125);
  EXPECT_LT(nees, 245);
}

TEST(StationOffset, WrongTapeIsFoundByOtherTagsToo) {
  Scene scene(5, {0, 0.12, 0});
  const StationOffset o = EstimateStationOffset(scene.station, "p.jpg", scene.See(1, 3), scene.map, Exact());
  ASSERT_TRUE(o.offset_m) << o.reason;
  EXPECT_FALSE(o.own_tag);
  EXPECT_TRUE(o.Contradicts());
  EXPECT_NEAR(o.offset_m->y(), scene.station.offset_m.y() - 0.12, 4 * std::sqrt(o.covariance(1, 1)));
  EXPECT_EQ(o.combined_m, o.stated_m);
}

TEST(StationOffset, SaysWhatItLacks) {
  Scene scene(3);
  EXPECT_FALSE(EstimateStationOffset(scene.station, "p.jpg", {}, scene.map, Exact()).offset_m);
  scene.map.erase(scene.map.begin());
  const StationOffset o = EstimateStationOffset(scene.station, "p.jpg", scene.See(1, 3), scene.map, Exact());
  EXPECT_FALSE(o.offset_m);
  EXPECT_NE(o.reason.find("tag 7"), std::string::npos);
}

}  // namespace
}  // namespace trigpoint
