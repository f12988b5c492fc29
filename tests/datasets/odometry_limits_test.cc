// Odometry of two dimensions, and times of images that are cut off.
#include "datasets/io/odometry_limits.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trigpoint {
namespace {

constexpr int64_t kHalf_ns = 500'000'000;

Trajectory Path(double height_m, double pitch_rad) {
  Trajectory path;
  for (int k = 0; k < 40; ++k) {
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(0.1 * k, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(pitch_rad * std::sin(k), Eigen::Vector3d::UnitY());
    path.poses.push_back({k * kHalf_ns, Rigid3d(turn, {0.5 * k, 0, 0.3 + height_m * std::sin(k)})});
  }
  return path;
}

TEST(IsFlat, WhereHeightsRollAndPitchNeverChange) {
  EXPECT_TRUE(IsFlat(Path(0, 0)));
  EXPECT_FALSE(IsFlat(Path(0.001, 0)));
  EXPECT_FALSE(IsFlat(Path(0, 0.001)));
  Trajectory few = Path(0, 0);
  few.poses.resize(9);
  EXPECT_FALSE(IsFlat(few));
}

Run RunWith(const std::vector<double>& times_s) {
  Run run;
  run.odometry = Path(0, 0);
  for (const double time_s : times_s) {
    ImageEntry image;
    image.stamp_ns = std::llround(1e9 * time_s);
    run.images.push_back(image);
  }
  return run;
}

TEST(TimeResolution, OfTimesThatAreCutOff) {
  EXPECT_EQ(TimeResolution(RunWith({0, 1, 3, 4, 6, 7, 9})), 1) << "every 1.5 s";
  EXPECT_EQ(TimeResolution(RunWith({0, 2, 4, 6, 9, 11, 13, 15})), 0) << "every 2 s, with a break";
  EXPECT_EQ(TimeResolution(RunWith({0, 2, 5, 7, 12, 14, 23})), 0) << "pictures that somebody chose";
  EXPECT_EQ(TimeResolution(RunWith({0, 1, 3, 4.5, 6, 7, 9})), 0);
  EXPECT_EQ(TimeResolution(RunWith({0, 2, 4, 6, 10, 12, 14})), 0) << "every 2 s, one is missing";
  EXPECT_EQ(TimeResolution(RunWith({0, 1, 2, 3, 4, 6, 7, 8, 9})), 0) << "every second, one is missing";
  trigpoint::Run whole = RunWith({0, 1, 3, 4, 6, 7, 9});
  for (TimedPose& pose : whole.odometry.poses) pose.stamp_ns *= 2;
  EXPECT_EQ(TimeResolution(whole), 0) << "odometry is of the same times";
}

}  // namespace
}  // namespace trigpoint
