// The length of a run without odometry whose cameras stand apart on the body.
#include "localize/reconstruct/rig_length.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/geo/geodetic.h"
#include "localize/reconstruct/reconstruct_run.h"
#include "tests/localize/test_scene.h"

namespace trigpoint {
namespace {

using test::See;

constexpr int kCameras = 2;

struct Rig {
  LocalizeInput input;
  std::vector<FeatureSet> seen;         // of each image
  std::vector<Rigid3d> odom_from_body;  // truth, m
};

// A lap and a bit round the middle of a yard with two cameras that look to the right, with parallel axes, 0.7 px of
// noise, and the walls 5 to 8 m away.
Rig MakeRig(double baseline_m, uint64_t seed) {
  constexpr double kRadius_m = 8, kStep_m = 2;
  Rig rig;
  Random random(seed);
  Eigen::Matrix3d axes;  // camera (right, down, forward) in the body's (forward, left, up)
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Quaterniond cam_from_body(axes * Eigen::AngleAxisd(45 * kDegToRad, Eigen::Vector3d::UnitZ()));
  for (int c = 0; c < kCameras; ++c) {
    const Eigen::Vector3d centre =
        Eigen::Vector3d(0.4, 0.1, 0.2) + cam_from_body.conjugate() * Eigen::Vector3d(c * baseline_m, 0, 0);
    BodyCamera camera;
    camera.name = "cam" + std::to_string(c);
    camera.camera = Camera::FromFieldOfView(960, 600, 1.7);
    camera.cam_from_body = {cam_from_body, -(cam_from_body * centre)};
    camera.has_extrinsics = true;
    rig.input.cameras.push_back(camera);
  }
  std::vector<Eigen::Vector3d> points;
  std::vector<uint64_t> spots;
  for (uint64_t j = 0; j < 2500; ++j) {
    const double a = random.Uniform(0, 2 * EIGEN_PI), r = random.Uniform(13, 16);
    points.emplace_back(r * std::cos(a), r * std::sin(a), random.Uniform(-2, 5));
    spots.push_back(j);
  }
  const int poses = static_cast<int>(1.2 * 2 * EIGEN_PI * kRadius_m / kStep_m);
  for (int k = 0; k < poses; ++k) {
    const double a = k * kStep_m / kRadius_m;
    const Rigid3d odom_from_body(Eigen::Quaterniond(Eigen::AngleAxisd(a + 0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ())),
                                 Eigen::Vector3d(kRadius_m * std::cos(a), kRadius_m * std::sin(a), 0));
    rig.odom_from_body.push_back(odom_from_body);
    rig.input.pose_stamps.push_back(k * 500000000LL);
    for (int c = 0; c < kCameras; ++c) {
      const BodyCamera& camera = rig.input.cameras[static_cast<size_t>(c)];
      const auto picture = static_cast<uint64_t>(kCameras * k + c) + 1000 * seed;
      rig.input.images.push_back({k * 500000000LL, std::to_string(k) + "_" + std::to_string(c), c, k});
      rig.seen.push_back(
          See(camera.camera, camera.cam_from_body * odom_from_body.Inverse(), points, spots, 14, 0.7, picture)
              .features);
    }
  }
  rig.input.odom_from_body.assign(rig.odom_from_body.size(), Rigid3d());
  rig.input.has_odometry = false;
  return rig;
}

// By the images of the first camera alone; leaves their motion in the input.
Reconstruction SolveFirst(Rig* rig) {
  rig->input.image_features = [rig](int i) { return rig->seen[static_cast<size_t>(i)]; };
  const std::vector<int> images = ImagesOfFirstCentre(rig->input);
  EXPECT_EQ(kCameras * images.size(), rig->input.images.size());
  ProgressSink progress;
  const ImageMotion motion = MotionFromImages(OnlyImages(rig->input, images), {}, {}, 2, 1, progress, {});
  EXPECT_EQ(motion.placed, static_cast<int>(rig->odom_from_body.size()));
  for (size_t k = 0; k < motion.odom_from_body.size(); ++k) {
    rig->input.odom_from_body[k] = motion.odom_from_body[k].value_or(Rigid3d());
  }
  Reconstruction r = ReconstructRun(OnlyImages(rig->input, images), {}, false, 2, 1, progress, {}).reconstruction;
  for (int& image : r.image_of) image = images[static_cast<size_t>(image)];
  return r;
}

// Root mean square distance of the first camera's places from their middle.
double ExtentOf(const Rig& rig, const std::vector<Rigid3d>& body_from_odom) {
  const Rigid3d& cam_from_body = rig.input.cameras.front().cam_from_body;
  Eigen::Matrix3Xd places(3, body_from_odom.size());
  for (size_t k = 0; k < body_from_odom.size(); ++k) {
    places.col(static_cast<Eigen::Index>(k)) = (cam_from_body * body_from_odom[k]).TargetOriginInSource();
  }
  return std::sqrt((places.colwise() - places.rowwise().mean()).colwise().squaredNorm().mean());
}

double TrueExtent(const Rig& rig) {
  std::vector<Rigid3d> body_from_odom;
  for (const Rigid3d& pose : rig.odom_from_body) body_from_odom.push_back(pose.Inverse());
  return ExtentOf(rig, body_from_odom);
}

TEST(LengthByRig, IsTrueWithinItsSigma) {
  double squares = 0;
  for (const uint64_t seed : {3, 4, 5}) {
    Rig rig = MakeRig(0.3, seed);
    const Reconstruction first = SolveFirst(&rig);
    const RigLength length = LengthByRig(rig.input, first, {}, 2, {});
    ASSERT_TRUE(length.known) << length.matches << " matches, sigma " << length.sigma_share;
    EXPECT_LT(length.sigma_share, 0.05);
    const double truth = TrueExtent(rig) / ExtentOf(rig, first.problem.poses);
    squares += std::pow((length.m_per_unit / truth - 1) / length.sigma_share, 2);
  }
  EXPECT_LT(squares, 16.3) << "chi-square, 3 dof, 0.1 %";
}

TEST(LengthByRig, MakesAReconstructionOfAllCamerasMetric) {
  Rig rig = MakeRig(0.3, 6);
  const Reconstruction first = SolveFirst(&rig);
  const RigLength length = LengthByRig(rig.input, first, {}, 2, {});
  ASSERT_TRUE(length.known);
  rig.input.odom_from_body = MotionInMetres(rig.input, first, length.m_per_unit);
  EXPECT_LT(rig.input.odom_from_body.front().translation.norm(), 1e-9);
  ProgressSink progress;
  const Reconstruction all = ReconstructRun(rig.input, {}, false, 2, 1, progress, {}).reconstruction;
  EXPECT_NEAR(ExtentOf(rig, all.problem.poses) / TrueExtent(rig), 1, 4 * length.sigma_share);
  int of_second = 0, active = 0;
  for (const BearingObservation& o : all.problem.observations) {
    of_second += o.view == 1 ? 1 : 0;
    active += o.view == 1 && o.active ? 1 : 0;
  }
  EXPECT_GT(of_second, 500);
  EXPECT_GT(active, 0.8 * of_second) << "nothing contradicts the second camera";
}

TEST(LengthByRig, IsNotKnownWhereCamerasDoNotShowIt) {
  Rig rig = MakeRig(0.002, 7);
  const Reconstruction first = SolveFirst(&rig);
  const RigLength length = LengthByRig(rig.input, first, {}, 2, {});
  EXPECT_GT(length.matches, 100);
  EXPECT_LT(length.contradiction_sigmas, 1) << "so short a distance contradicts no unit";
  EXPECT_FALSE(length.known) << length.m_per_unit << " " << length.sigma_share;
  // Matches whose pixels are those of other matches agree on nothing.
  for (size_t i = 1; i < rig.seen.size(); i += kCameras) {
    std::vector<Eigen::Vector2f>& pixels = rig.seen[i].points;
    std::rotate(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(pixels.size() / 3), pixels.end());
  }
  EXPECT_FALSE(LengthByRig(rig.input, first, {}, 2, {}).known);
}

TEST(ImagesOfFirstCentre, FollowsTheCameraThatComesFirst) {
  LocalizeInput input;
  input.cameras.resize(3);
  input.cameras[2].cam_from_body.translation = {0.1, 0, 0};
  // The second looks elsewhere from the first one's centre; at the second pose the first has no image.
  input.cameras[1].cam_from_body.rotation = Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ());
  input.pose_stamps = {0, 1};
  input.images = {{0, "a", 0, 0}, {0, "b", 1, 0}, {0, "c", 2, 0}, {1, "d", 2, 1}, {1, "e", 2, 1}};
  const std::vector<int> images = ImagesOfFirstCentre(input);
  EXPECT_EQ(images, (std::vector<int>{0, 1, 3, 4}));
  const LocalizeInput some = OnlyImages(input, images);
  ASSERT_EQ(some.images.size(), 4);
  EXPECT_EQ(some.images[2].name, "d");
}

}  // namespace
}  // namespace trigpoint
