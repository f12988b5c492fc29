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

// A camera that only turns: nothing has a place.
TEST(MotionFromImages, RefusesImagesWithoutParallax) {
  Drive drive = MakeDrive(0.3, 6, 2.0);
  for (size_t i = 0; i < drive.seen.size(); ++i) drive.seen[i] = drive.seen[0];
  EXPECT_THROW(Solve(drive), InputError);
}

}  // namespace
}  // namespace trigpoint
