// A reference that sees a wall, or the ground, from another side than the run's images, and whose features are up to a
// pixel elsewhere.
#include "localize/references/align_views.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <utility>

#include "tests/localize/test_scene.h"
#include "tests/localize/textured_plane.h"

namespace trigpoint {
namespace {

constexpr int kImages = 3, kPoints = 80;

struct Plane {
  Eigen::Vector3d normal;  // run's frame: x right, y down, z forward
  double distance = 0;
  double shortest_m = 0;  // wave of its texture
  Rigid3d view_from_world;
};

Rigid3d Looking(double yaw, double pitch, const Eigen::Vector3d& from) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()));
  return Rigid3d(turn, from).Inverse();
}

// 7 m ahead, seen from 3 m further to the right.
Plane Wall() { return {{0.2, 0, -1}, 7, 0.1, Looking(-0.45, 0, {3, 0.2, 0})}; }
// 1.5 m below, seen from the right.
Plane Ground() { return {{0, 1, 0}, -1.5, 0.3, Looking(-1.0, -0.15, {4.5, -0.3, 3})}; }

class OnePicture final : public ReferencePictures {
 public:
  explicit OnePicture(cv::Mat picture) : picture_(std::move(picture)) {}
  cv::Mat View(int) const override { return picture_; }

 private:
  cv::Mat picture_;
};

class Scene {
 public:
  explicit Scene(const Plane& plane, bool other_texture = false) : plane_(plane) {
    Random random(3);
    BodyCamera camera;
    camera.name = "cam0";
    camera.camera = Camera::FromFieldOfView(400, 300, 1.0);
    input.cameras = {camera};
    r.problem.views = {Rigid3d(), Rigid3d()};
    const std::vector<Wave> texture = MakeTexture(1, plane.shortest_m), another = MakeTexture(2, plane.shortest_m);
    for (int i = 0; i < kImages; ++i) {
      r.problem.poses.push_back(Looking(0.03 * i, -0.1, {0.3 * i, 0, 0.2 * i}));
      input.images.push_back({i, "", 0, i});
      pictures_.push_back(Render(r.problem.poses.back(), texture, &random));
    }
    r.problem.poses.push_back(plane.view_from_world);
    view_picture_ = Render(plane.view_from_world, other_texture ? another : texture, &random);
    View view;
    view.camera = camera.camera;
    references.emplace_back().rig.views = {view};
    input.image_picture = [this](int i) { return pictures_[static_cast<size_t>(i)]; };
    input.reference_pictures = [this](int) { return std::make_unique<OnePicture>(view_picture_); };
    input.image_features = [](int) {
      FeatureSet f;
      f.scales.assign(kPoints, 2.0F);
      return f;
    };
    while (r.problem.points.size() < kPoints) AddPoint(&random);
  }

  AlignedViews Align(int threads = 2) const {
    ProgressSink progress;
    return AlignViews(input, references, {1}, r, threads, progress, {});
  }

  // Of the reference's observations of these points from where it shows them, px: the RMS, and the length of the mean.
  struct Errors {
    double rms = 0, mean = 0;
  };
  Errors ErrorsOf(const std::vector<std::pair<size_t, Eigen::Vector2d>>& seen) const {
    double squares = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const auto& [k, pixel] : seen) {
      const Eigen::Vector3d& spot = r.problem.points[static_cast<size_t>(r.problem.observations[k].point)];
      const Eigen::Vector2d off = pixel - *TheCamera().Project(plane_.view_from_world * spot);
      squares += off.squaredNorm(), sum += off;
    }
    const auto n = static_cast<double>(seen.size());
    return {std::sqrt(squares / n), sum.norm() / n};
  }
  Errors ErrorsBefore() const {
    std::vector<std::pair<size_t, Eigen::Vector2d>> seen;
    for (size_t k = 0; k < r.problem.observations.size(); ++k) {
      if (r.image_of[k] < 0) seen.emplace_back(k, *TheCamera().Project(r.problem.observations[k].ray.cast<double>()));
    }
    return ErrorsOf(seen);
  }
  Errors ErrorsOf(const AlignedViews& aligned) const {
    std::vector<std::pair<size_t, Eigen::Vector2d>> seen;
    for (size_t k = 0; k < aligned.observations.size(); ++k)
      seen.emplace_back(aligned.observations[k], aligned.pixels[k].cast<double>());
    return ErrorsOf(seen);
  }

  LocalizeInput input;
  Reconstruction r;
  std::vector<ReferenceViews> references;

 private:
  const Camera& TheCamera() const { return input.cameras.front().camera; }

  cv::Mat Render(const Rigid3d& camera_from_world, const std::vector<Wave>& texture, Random* random) const {
    cv::Mat picture(TheCamera().height(), TheCamera().width(), CV_8U, cv::Scalar(128));
    const double gain = random->Uniform(0.8, 1.2), offset = random->Uniform(-10, 10);
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        const Eigen::Vector3d ray = *TheCamera().Unproject(Eigen::Vector2d(x, y));
        const Eigen::Vector3d p = OnPlane(plane_.normal, plane_.distance, camera_from_world, ray);
        if ((camera_from_world * p).z() < 0 || p.norm() > 30) continue;
        const Eigen::Vector2d at(p.x(), plane_.normal.y() == 1 ? p.z() : p.y());
        picture.at<uchar>(y, x) =
            cv::saturate_cast<uchar>(128 + gain * (GreyOf(texture, at) - 128) + offset + random->Normal());
      }
    }
    return picture;
  }

  // The images show exactly the spot, which is what aligned ones do.
  void AddPoint(Random* random) {
    const Eigen::Vector2d pixel(random->Uniform(60, 340), random->Uniform(60, 240));
    const Eigen::Vector3d spot =
        OnPlane(plane_.normal, plane_.distance, plane_.view_from_world, *TheCamera().Unproject(pixel));
    const int point = static_cast<int>(r.problem.points.size());
    std::vector<BearingObservation> seen;
    for (int i = 0; i < kImages; ++i) {
      const auto in_image = TheCamera().Project(r.problem.poses[static_cast<size_t>(i)] * spot);
      if (!in_image || !TheCamera().Contains(*in_image)) return;
      seen.push_back(*ObservationOf(input, {point, i, point, in_image->cast<float>()}, 1));
    }
    for (int i = 0; i < kImages; ++i) Add(seen[static_cast<size_t>(i)], i, point);
    BearingObservation o;
    o.point = point, o.pose = kImages, o.view = 1;
    // Features are off by 0.5 px in common, as those of one surface are.
    const Eigen::Vector2d found = pixel + Eigen::Vector2d(random->Uniform(-0.2, 1.2), random->Uniform(-0.7, 0.7));
    o.ray = TheCamera().Unproject(found)->cast<float>();
    o.w = TheCamera().BearingSqrtInfo(found, 1).cast<float>();
    Add(o, -1, point);
    r.problem.points.push_back(spot);
    r.point_valid.push_back(true);
  }
  void Add(const BearingObservation& o, int image, int feature) {
    r.problem.observations.push_back(o);
    r.image_of.push_back(image);
    r.feature_of.push_back(feature);
  }

  Plane plane_;
  std::vector<cv::Mat> pictures_;
  cv::Mat view_picture_;
};

TEST(AlignViews, ShowTheSpotsThatImagesShowOnAWall) {
  const Scene scene(Wall());
  const AlignedViews aligned = scene.Align();
  EXPECT_GT(aligned.tried, 0.9 * kPoints);
  EXPECT_GT(aligned.observations.size(), 0.9 * kPoints);
  EXPECT_GT(scene.ErrorsBefore().rms, 0.5);
  EXPECT_LT(scene.ErrorsOf(aligned).rms, 0.06);
}

// A pixel of the images is some 0.3 m of depth on the ground, which lies across in the view: so a tenth of a pixel is
// much there. But errors have no common part (0.4 px with warps that are linear).
TEST(AlignViews, ShowTheSpotsThatImagesShowOnTheGround) {
  const Scene scene(Ground());
  const AlignedViews aligned = scene.Align();
  EXPECT_GT(scene.ErrorsBefore().mean, 0.4);
  EXPECT_GT(aligned.observations.size(), 0.3 * kPoints);
  EXPECT_LT(scene.ErrorsOf(aligned).rms, 0.5);
  EXPECT_LT(scene.ErrorsOf(aligned).mean, 0.12);
}

TEST(AlignViews, LeaveWhatLooksOtherwise) {
  const AlignedViews aligned = Scene(Wall(), true).Align();
  EXPECT_GT(aligned.tried, 0.9 * kPoints);
  EXPECT_LT(aligned.observations.size(), 0.05 * kPoints);
  EXPECT_EQ(aligned.observations.size() + aligned.elsewhere.size(), static_cast<size_t>(aligned.tried));
}

TEST(AlignViews, DependOnNoThreads) {
  const Scene scene(Wall());
  const AlignedViews one = scene.Align(1), two = scene.Align(2);
  EXPECT_EQ(one.observations, two.observations);
  EXPECT_EQ(one.pixels, two.pixels);
}

TEST(AlignViews, LeaveAllWherePicturesHaveGone) {
  Scene scene(Wall());
  scene.input.reference_pictures = [](int) { return std::make_unique<OnePicture>(cv::Mat()); };
  const AlignedViews aligned = scene.Align();
  EXPECT_TRUE(aligned.observations.empty());
  EXPECT_TRUE(aligned.elsewhere.empty());
}

}  // namespace
}  // namespace trigpoint
