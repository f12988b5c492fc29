// Pictures of a slanted wall, whose features each image finds up to a pixel elsewhere.
#include "localize/reconstruct/patch_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/localize/test_scene.h"
#include "tests/localize/textured_plane.h"

namespace trigpoint {
namespace {

// The wall: z = 6 + x tan 35 deg, in the first camera's frame.
const Eigen::Vector3d kNormal(std::tan(35 * EIGEN_PI / 180), 0, -1);
constexpr double kDistance = 6;

Eigen::Vector3d OnWall(const Rigid3d& camera_from_world, const Eigen::Vector3d& ray) {
  return OnPlane(kNormal, kDistance, camera_from_world, ray);
}

struct Wall {
  static constexpr int kImages = 7;

  explicit Wall(int other_picture = -1) {
    Random random(3);
    BodyCamera camera;
    camera.name = "cam0";
    camera.camera = Camera::FromFieldOfView(400, 300, 1.0);
    input.cameras = {camera};
    r.problem.views = {Rigid3d()};
    const std::vector<Wave> texture = MakeTexture(1), another = MakeTexture(2);
    for (int i = 0; i < kImages; ++i) {
      const double s = 0.25 * (i - kImages / 2);
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05 * s, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(0.2 * s, Eigen::Vector3d::UnitZ()));
      const Rigid3d world_from_camera{turn, Eigen::Vector3d(s, 0.1 * s, 0.3 * s)};
      r.problem.poses.push_back(world_from_camera.Inverse());
      input.images.push_back({i, "", 0, i});
      pictures.push_back(Render(i, i == other_picture ? another : texture, &random));
    }
    input.image_picture = [this](int i) { return pictures[static_cast<size_t>(i)]; };
    input.image_features = [this](int i) {
      FeatureSet f;
      f.scales.assign(features[static_cast<size_t>(i)], 2.0F);
      return f;
    };
    AddPoints(&random);
  }

  const Camera& TheCamera() const { return input.cameras.front().camera; }

  cv::Mat Render(int image, const std::vector<Wave>& texture, Random* random) const {
    cv::Mat picture(TheCamera().height(), TheCamera().width(), CV_8U);
    const double gain = random->Uniform(0.8, 1.2), offset = random->Uniform(-10, 10);
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        const Eigen::Vector3d p =
            OnWall(r.problem.poses[static_cast<size_t>(image)], *TheCamera().Unproject(Eigen::Vector2d(x, y)));
        picture.at<uchar>(y, x) =
            cv::saturate_cast<uchar>(128 + gain * (GreyOf(texture, p.head<2>()) - 128) + offset + 2 * random->Normal());
      }
    }
    return picture;
  }

  void AddPoints(Random* random) {
    features.assign(kImages, 0);
    while (r.problem.points.size() < 100) {
      const Eigen::Vector2d pixel(random->Uniform(100, 300), random->Uniform(80, 220));
      const Eigen::Vector3d spot = OnWall(r.problem.poses[kImages / 2], *TheCamera().Unproject(pixel));
      for (int i = 0; i < kImages; ++i) {
        const Eigen::Vector2d true_pixel = *TheCamera().Project(r.problem.poses[static_cast<size_t>(i)] * spot);
        const Eigen::Vector2d found =
            true_pixel + Eigen::Vector2d(random->Uniform(-0.7, 0.7), random->Uniform(-0.7, 0.7));
        const int feature = features[static_cast<size_t>(i)]++;
        const TrackObservation t{static_cast<int>(r.problem.points.size()), i, feature, found.cast<float>()};
        r.problem.observations.push_back(*ObservationOf(input, t, 1));
        r.image_of.push_back(i);
        r.feature_of.push_back(feature);
      }
      r.problem.points.push_back(spot);
      r.point_valid.push_back(true);
    }
  }

  // Of an observation from where its image shows what the middle image's observation of the point shows, px.
  double Error(const TrackObservation& t) const {
    const BearingObservation& middle = r.problem.observations[static_cast<size_t>(t.track * kImages + kImages / 2)];
    const Eigen::Vector3d spot = OnWall(r.problem.poses[kImages / 2], middle.ray.cast<double>());
    const Eigen::Vector2d pixel = *TheCamera().Project(r.problem.poses[static_cast<size_t>(t.image)] * spot);
    return (t.pixel.cast<double>() - pixel).norm();
  }

  AlignedTracks Align(int threads = 2) const {
    ProgressSink progress;
    return AlignPatches(input, r, threads, progress, {});
  }

  LocalizeInput input;
  Reconstruction r;
  std::vector<cv::Mat> pictures;
  std::vector<int> features;
};

TEST(PatchAlignment, ObservationsShowTheSameSpot) {
  const Wall wall;
  const AlignedTracks aligned = wall.Align();
  EXPECT_EQ(aligned.tried, 100 * (Wall::kImages - 1));
  EXPECT_GT(aligned.aligned, 0.9 * static_cast<double>(aligned.tried));
  double before = 0, after = 0;
  for (const TrackObservation& t : aligned.observations) after += std::pow(wall.Error(t), 2);
  for (size_t k = 0; k < wall.r.problem.observations.size(); ++k) {
    const BearingObservation& o = wall.r.problem.observations[k];
    const Eigen::Vector2d pixel = *wall.TheCamera().Project(o.ray.cast<double>());
    before += std::pow(wall.Error({o.point, wall.r.image_of[k], 0, pixel.cast<float>()}), 2);
  }
  before = std::sqrt(before / static_cast<double>(wall.r.problem.observations.size()));
  after = std::sqrt(after / static_cast<double>(aligned.observations.size()));
  EXPECT_GT(before, 0.6);
  EXPECT_LT(after, 0.06);
}

TEST(PatchAlignment, LeavesOutWhatShowsSomethingElse) {
  constexpr int kOther = 1;
  const AlignedTracks aligned = Wall(kOther).Align();
  int there = 0;
  for (const TrackObservation& t : aligned.observations) there += t.image == kOther ? 1 : 0;
  EXPECT_LE(there, 3);
  EXPECT_GT(aligned.aligned, 0.9 * 100 * (Wall::kImages - 2));
}

TEST(PatchAlignment, TouchesNoRollingShutter) {
  Wall wall;
  wall.input.cameras[0].readout_s = 0.02;
  const AlignedTracks aligned = wall.Align();
  EXPECT_EQ(aligned.tried, 0);
  ASSERT_EQ(aligned.observations.size(), wall.r.problem.observations.size());
  for (size_t k = 0; k < aligned.observations.size(); ++k) {
    const Eigen::Vector2d pixel = *wall.TheCamera().Project(wall.r.problem.observations[k].ray.cast<double>());
    EXPECT_EQ(aligned.observations[k].pixel, pixel.cast<float>());
  }
}

TEST(PatchAlignment, DependsOnNoThreads) {
  const Wall wall;
  const AlignedTracks one = wall.Align(1), two = wall.Align(2);
  ASSERT_EQ(one.observations.size(), two.observations.size());
  for (size_t k = 0; k < one.observations.size(); ++k) EXPECT_EQ(one.observations[k].pixel, two.observations[k].pixel);
}

TEST(PatchAlignment, PicturesThatHaveGoneChangeNothing) {
  Wall wall;
  wall.input.image_picture = [](int) { return cv::Mat(); };
  const AlignedTracks aligned = wall.Align();
  EXPECT_EQ(aligned.aligned, 0);
  EXPECT_EQ(aligned.observations.size(), wall.r.problem.observations.size());
}

}  // namespace
}  // namespace trigpoint
