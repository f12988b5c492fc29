// The motion of runs that have no odometry.
#include "localize/reconstruct/structure_from_motion.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "tests/localize/test_drive.h"

namespace trigpoint {
namespace {

using test::Drive;
using test::MakeDrive;

ImageMotion Solve(Drive& drive) {
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i)].features; };
  drive.input.odom_from_body.assign(drive.odom_from_body.size(), Rigid3d());
  ProgressSink progress;
  return MotionFromImages(drive.input, {}, {}, 2, 1, progress, {});
}

// Images in another order: neither their times nor their numbers show what lies beside what.
void Shuffle(Drive* drive) {
  std::vector<int> order(drive->seen.size());
  std::iota(order.begin(), order.end(), 0);
  Random random(9);
  random.Shuffle(order);
  const Drive before = *drive;
  for (size_t i = 0; i < order.size(); ++i) {
    drive->seen[i] = before.seen[static_cast<size_t>(order[i])];
    drive->odom_from_body[i] = before.odom_from_body[static_cast<size_t>(order[i])];
  }
}

struct Fit {
  int placed = 0;
  double position = 0, rotation_deg = 0;  // root mean squares after the similarity that fits best, m, deg
};

Fit Compare(const Drive& drive, const ImageMotion& motion) {
  std::vector<size_t> placed;
  for (size_t i = 0; i < motion.odom_from_body.size(); ++i) {
    if (motion.odom_from_body[i]) placed.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(placed.size());
  Eigen::Matrix3Xd from(3, n), to(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    from.col(i) = motion.odom_from_body[placed[static_cast<size_t>(i)]]->translation;
    to.col(i) = drive.odom_from_body[placed[static_cast<size_t>(i)]].translation;
  }
  const Eigen::Matrix4d fit = Eigen::umeyama(from, to, true);
  const double scale = std::cbrt(fit.topLeftCorner<3, 3>().determinant());
  const Eigen::Quaterniond turn(Eigen::Matrix3d(fit.topLeftCorner<3, 3>() / scale));
  Fit out;
  out.placed = static_cast<int>(n);
  out.position = std::sqrt(
      ((fit.topLeftCorner<3, 3>() * from).colwise() + fit.topRightCorner<3, 1>() - to).colwise().squaredNorm().mean());
  for (size_t i : placed) {
    out.rotation_deg += std::pow(
        (turn * motion.odom_from_body[i]->rotation).angularDistance(drive.odom_from_body[i].rotation) / kDegToRad, 2);
  }
  out.rotation_deg = std::sqrt(out.rotation_deg / static_cast<double>(n));
  return out;
}

TEST(MotionFromImages, PlacesPhotosThatStandFarApart) {
  Drive drive = MakeDrive(1.2, 3, 2.0);
  Shuffle(&drive);
  const Fit fit = Compare(drive, Solve(drive));
  EXPECT_EQ(fit.placed, static_cast<int>(drive.seen.size()));
  EXPECT_LT(fit.position, 0.05);
  EXPECT_LT(fit.rotation_deg, 0.3);
}

TEST(MotionFromImages, PlacesMoreImagesThanAreComparedWithEachOther) {
  Drive drive = MakeDrive(1.2, 4, 0.7);
  Shuffle(&drive);
  ASSERT_GT(static_cast<int>(drive.seen.size()), StructureFromMotionOptions().exhaustive);
  const Fit fit = Compare(drive, Solve(drive));
  EXPECT_EQ(fit.placed, static_cast<int>(drive.seen.size()));
  EXPECT_LT(fit.position, 0.05);
  EXPECT_LT(fit.rotation_deg, 0.3);
}

TEST(MotionFromImages, IsTheSameWithAnyNumberOfThreads) {
  Drive drive = MakeDrive(0.6, 5, 2.0);
  const ImageMotion two = Solve(drive);
  ProgressSink progress;
  const ImageMotion one = MotionFromImages(drive.input, {}, {}, 1, 1, progress, {});
  ASSERT_EQ(one.placed, two.placed);
  for (size_t i = 0; i < one.odom_from_body.size(); ++i) {
    ASSERT_EQ(one.odom_from_body[i].has_value(), two.odom_from_body[i].has_value());
    if (!one.odom_from_body[i]) continue;
    EXPECT_EQ(one.odom_from_body[i]->translation, two.odom_from_body[i]->translation);
    EXPECT_EQ(one.odom_from_body[i]->rotation.coeffs(), two.odom_from_body[i]->rotation.coeffs());
  }
}

// The next images of a rig are of the same moment: the neighbours of an image are those of its camera.
TEST(MotionFromImages, PairsTheImagesOfEachCameraOfARig) {
  constexpr int kCameras = 5;
  Drive drive = MakeDrive(0.3, 7, 0.7);
  const int moments = static_cast<int>(drive.seen.size());
  drive.input.cameras.assign(kCameras, drive.input.cameras.front());
  drive.input.images.clear();
  for (int k = 0; k < moments; ++k) {
    const int64_t stamp = drive.input.pose_stamps[static_cast<size_t>(k)];
    for (int c = 0; c < kCameras; ++c) {
      drive.input.images.push_back({stamp, std::to_string(k) + "_" + std::to_string(c), c, k});
    }
  }
  drive.input.image_features = [&drive](int i) { return drive.seen[static_cast<size_t>(i / kCameras)].features; };
  StructureFromMotionOptions options;
  options.exhaustive = 2, options.retrieved = 1, options.neighbours = 4;
  ProgressSink progress;
  // The last four of a camera have 3, 2, 1 and no next ones.
  EXPECT_GE(MotionFromImages(drive.input, options, {}, 2, 1, progress, {}).pairs_tried, kCameras * (4 * moments - 10));
}

// Pictures of one camera, taken on a way that climbs.
struct Round {
  LocalizeInput input;
  ImageMotion motion;  // in the frame of the first pose
  std::vector<Rigid3d> world_from_body;
  std::vector<Eigen::Vector3d> tops;
};

Round MakeRound(const std::vector<Eigen::Quaterniond>& world_from_cam, const Rigid3d& cam_from_body) {
  Round round;
  BodyCamera& camera = round.input.cameras.emplace_back();
  camera.cam_from_body = cam_from_body;
  for (size_t k = 0; k < world_from_cam.size(); ++k) {
    round.input.images.push_back({static_cast<int64_t>(k), std::to_string(k), 0, static_cast<int>(k)});
    const Eigen::Vector3d place = static_cast<double>(k) * Eigen::Vector3d(1, 2, 0.5);
    round.world_from_body.push_back(Rigid3d(world_from_cam[k], place) * cam_from_body);
    round.motion.odom_from_body.push_back(round.world_from_body.front().Inverse() * round.world_from_body.back());
    round.tops.push_back(-Eigen::Vector3d::UnitY());
  }
  return round;
}

// How far z is from up, rad, and how much of the climb is missing.
double Tilt(const Round& round) {
  double worst = 0;
  for (size_t k = 0; k < round.world_from_body.size(); ++k) {
    const std::optional<Rigid3d>& pose = round.motion.odom_from_body[k];
    if (!pose) continue;
    const Rigid3d odom_from_world = *pose * round.world_from_body[k].Inverse();
    worst = std::max(worst, (odom_from_world.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm());
    const double climb = round.world_from_body[k].translation.z() - round.world_from_body[0].translation.z();
    worst = std::max(worst, std::abs(pose->translation.z() - climb));
  }
  return worst;
}

TEST(LevelMotion, FindsTheVerticalOfPictures) {
  constexpr int kPictures = 12;
  constexpr double kStep = 360.0 / kPictures * kDegToRad;
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ()));
  // All look up by 25 deg, as at facades; every other one was taken upright and is used as it is stored.
  std::vector<Eigen::Quaterniond> facades, down;
  for (int k = 0; k < kPictures; ++k) {
    facades.push_back(WorldFromCamRotation({k * kStep, 25 * kDegToRad, 0}));
    // Lanes to and fro, straight down.
    down.push_back(WorldFromCamRotation({(k % 4 < 2 ? 0 : 180) * kDegToRad, -90 * kDegToRad, 0}));
  }
  for (size_t k = 1; k < facades.size(); k += 2) facades[k] = facades[k] * quarter;
  Round round = MakeRound(facades, Rigid3d());
  for (size_t k = 1; k < facades.size(); k += 2) round.tops[k] = -Eigen::Vector3d::UnitX();
  EXPECT_GT(Tilt(round), 0.4);
  LevelMotion(round.input, round.tops, &round.motion);
  EXPECT_LT(Tilt(round), 1e-9);
  EXPECT_LT(round.motion.odom_from_body.front()->translation.norm(), 1e-9);

  round = MakeRound(down, Rigid3d());
  LevelMotion(round.input, round.tops, &round.motion);
  EXPECT_LT(Tilt(round), 1e-9);

  // A camera that is mounted on its side: its body stands upright. Images without a place do not matter.
  std::vector<Eigen::Quaterniond> aside;
  Eigen::Matrix3d forward;  // camera axes in the body's
  forward << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Rigid3d cam_from_body(quarter.conjugate() * Eigen::Quaterniond(forward), Eigen::Vector3d::Zero());
  for (int k = 0; k < kPictures; ++k) {
    aside.push_back(WorldFromCamRotation({k * kStep, 0, 0}) * quarter);
  }
  round = MakeRound(aside, cam_from_body);
  round.input.cameras[0].has_extrinsics = true;
  const Rigid3d turned(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX())), Eigen::Vector3d::Zero());
  for (std::optional<Rigid3d>& pose : round.motion.odom_from_body) pose = turned * *pose;
  round.motion.odom_from_body[3].reset();
  EXPECT_GT(Tilt(round), 0.4);
  LevelMotion(round.input, round.tops, &round.motion);
  EXPECT_LT(Tilt(round), 1e-9);
}

// A camera that only turns: nothing has a place.
TEST(MotionFromImages, RefusesImagesWithoutParallax) {
  Drive drive = MakeDrive(0.3, 6, 2.0);
  for (size_t i = 0; i < drive.seen.size(); ++i) drive.seen[i] = drive.seen[0];
  EXPECT_THROW(Solve(drive), InputError);
}

}  // namespace
}  // namespace trigpoint
