// Trajectories: TUM, EuRoC, KITTI; times to the nanosecond; interpolation.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "datasets/io/text.h"
#include "datasets/io/trajectory.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

constexpr int64_t kSecond = 1'000'000'000;

TEST(Seconds, AreExact) {
  EXPECT_EQ(ParseSecondsToNs("1403636579.763555584"), 1'403'636'579'763'555'584);
  EXPECT_EQ(ParseSecondsToNs("1403636579763555584"), 1'403'636'579'763'555'584);
  EXPECT_EQ(ParseSecondsToNs("1.403636579763555584e+09"), 1'403'636'579'763'555'584);
  EXPECT_EQ(ParseSecondsToNs(" -0.0000000015 "), -2);
  EXPECT_EQ(ParseSecondsToNs("5"), 5 * kSecond);
  EXPECT_EQ(ParseSecondsToNs("1e-10"), 0);
  for (const char* bad : {"", ".", "1,5", "abc", "1e", "nan", "1 2", "99999999999.0", "1e30"}) {
    EXPECT_THROW(ParseSecondsToNs(bad), InputError) << bad;
  }
  EXPECT_EQ(FormatNsAsSeconds(1'403'636'579'763'555'584), "1403636579.763555584");
  EXPECT_EQ(FormatNsAsSeconds(-1'500'000'000, 3), "-1.500");
  EXPECT_EQ(FormatNsAsSeconds(1'999'999'999, 3), "2.000");
  EXPECT_EQ(FormatNsAsSeconds(-1, 3), "0.000");
  EXPECT_EQ(FormatNsAsSeconds(1'500'000'000, 0), "2");
  for (int64_t ns : {int64_t{0}, int64_t{1}, -kSecond, int64_t{9'000'000'000'000'000'001}}) {
    EXPECT_EQ(ParseSecondsToNs(FormatNsAsSeconds(ns)), ns);
  }
}

TEST(Tum, KeepsWhatIsUsableAndNamesTheRest) {
  const TempDir dir;
  const auto file = dir.Write("odometry.tum",
                              "# timestamp tx ty tz qx qy qz qw\r\n"
                              "2 2 0 0 0 0 0 1\r\n1 1 0 0 0 0 0 1\r\n"    // out of order
                              "2 9 9 9 0 0 0 1\r\n3 nan 0 0 0 0 0 1\r\n"  // doubled, not finite
                              "4 4 0 0 0 0 0 2\r\n5 5 0 0\r\n"            // no unit quaternion, too short
                              "6 6 0 0 0 0 0 1.0005\r\nx 6 0 0 0 0 0 1\r\n");
  const Trajectory trajectory = ReadTrajectory(file);
  ASSERT_EQ(trajectory.poses.size(), 3u);
  EXPECT_EQ(trajectory.poses[1].stamp_ns, 2 * kSecond);
  EXPECT_EQ(trajectory.poses[1].target_from_body.translation.x(), 2);
  EXPECT_NEAR(trajectory.poses[2].target_from_body.rotation.norm(), 1, 1e-15);
  const std::string warnings = Joined(trajectory.warnings);
  EXPECT_THAT(warnings, HasSubstr("odometry.tum:5: the pose holds 'nan'; the row is skipped"));
  EXPECT_THAT(warnings, HasSubstr("odometry.tum:6: expected a unit quaternion, found one of length 2"));
  EXPECT_THAT(warnings, HasSubstr("odometry.tum:7: expected 8 numbers"));
  EXPECT_THAT(warnings, HasSubstr("odometry.tum:9: expected a time"));
  EXPECT_THAT(warnings, HasSubstr("out of order"));
  EXPECT_THAT(warnings, HasSubstr("1 pose with a timestamp seen before"));
}

// Two logs in one file begin again, too, but not within an hour of midnight.
TEST(Tum, RefusesSecondsOfTheDayThatPassMidnight) {
  const TempDir dir;
  const std::string pose = " 0 0 0 0 0 0 1\n";
  EXPECT_THAT(MessageOf<InputError>([&] {
                ReadTrajectory(dir.Write("night.tum", "86398" + pose + "86399.5" + pose + "0.5" + pose + "2" + pose));
              }),
              HasSubstr("night.tum: its times fall from 86399.500 to 0.500 s: seconds of the day"));
  EXPECT_NO_THROW(ReadTrajectory(dir.Write("logs.tum", "0" + pose + "900" + pose + "1" + pose + "2" + pose)));
  EXPECT_NO_THROW(ReadTrajectory(dir.Write("day.tum", "50000" + pose + "50001" + pose + "0" + pose)));
  EXPECT_NO_THROW(ReadTrajectory(dir.Write("last.tum", "1" + pose + "2" + pose + "86399" + pose + "3" + pose)));
}

TEST(Tum, RefusesWhatHoldsNothing) {
  const TempDir dir;
  EXPECT_THAT(
      MessageOf<InputError>([&] { ReadTrajectory(dir.Write("nan.tum", "#\n1 nan 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n")); }),
      HasSubstr("nan.tum:2: the pose holds 'nan'; no row of the file is usable"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadTrajectory(dir.Write("empty.tum", "# nothing\n")); }),
              HasSubstr("empty"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadTrajectory(dir / "none.tum"); }), HasSubstr("no such file"));
  const Trajectory constant = ReadTrajectory(dir.Write("c.tum", "1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0 1\n"));
  EXPECT_EQ(constant.poses.size(), 2u);
  EXPECT_THAT(Joined(constant.warnings), HasSubstr("all 2 poses are the same"));
}

TEST(Tum, ManyBadRowsAreCounted) {
  const TempDir dir;
  std::string text = "1 1 0 0 0 0 0 1\n";
  for (int i = 0; i < 100; ++i) text += "2 inf 0 0 0 0 0 1\n";
  const Trajectory trajectory = ReadTrajectory(dir.Write("t.tum", text));
  EXPECT_EQ(trajectory.warnings.size(), 6u);
  EXPECT_THAT(trajectory.warnings.back(), HasSubstr("95 more"));
}

TEST(Euroc, PutsWFirst) {
  const TempDir dir;
  const auto file = dir.Write("data.csv",
                              "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
                              "q_RS_z [], v_RS_R_x [m s^-1]\n1403636580838555648,1,2,3,0.8,0.6,0,0,9\n");
  const Trajectory trajectory = ReadTrajectory(file);
  EXPECT_EQ(trajectory.poses[0].stamp_ns, 1'403'636'580'838'555'648);
  EXPECT_DOUBLE_EQ(trajectory.poses[0].target_from_body.rotation.w(), 0.8);
  EXPECT_DOUBLE_EQ(trajectory.poses[0].target_from_body.rotation.x(), 0.6);
  // A table whose header names another order is believed.
  const auto named = dir.Write("named.csv", "timestamp,tx,ty,tz,qx,qy,qz,qw\n1.5,1,2,3,0.6,0,0,0.8\n");
  EXPECT_DOUBLE_EQ(ReadTrajectory(named).poses[0].target_from_body.rotation.w(), 0.8);
}

// A curve driven forward, its rows with commas.
std::string CurveRows(bool w_first, const std::string& more = "") {
  std::string text;
  for (int i = 0; i < 40; ++i) {
    const double a = 0.05 * i, x = 20 * std::sin(a), y = 20 * (1 - std::cos(a));
    const std::string w = std::to_string(std::cos(a / 2)), z = std::to_string(std::sin(a / 2));
    text += std::to_string(i) + "," + std::to_string(x) + "," + std::to_string(y) + ",0,";
    text += (w_first ? w + ",0,0," + z : "0,0," + z + "," + w) + more + "\n";
  }
  return text;
}

TEST(CommaRows, TheMotionDecidesTheOrder) {
  const TempDir dir;
  for (const bool w_first : {false, true}) {
    const Trajectory trajectory = ReadTrajectory(dir.Write("odometry.csv", CurveRows(w_first)));
    ASSERT_EQ(trajectory.poses.size(), 40u);
    EXPECT_NEAR(trajectory.poses[10].target_from_body.rotation.w(), std::cos(0.25), 1e-5) << w_first;
    EXPECT_NEAR(trajectory.poses[10].target_from_body.rotation.z(), std::sin(0.25), 1e-5) << w_first;
  }
  EXPECT_NEAR(ReadTrajectory(dir.Write("long.csv", CurveRows(true, ",1,2,3"))).poses[10].target_from_body.rotation.w(),
              std::cos(0.25), 1e-5);
  EXPECT_NEAR(ReadTrajectory(dir.Write("named.csv", "# a car\n# t,x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,0,1\n"))
                  .poses[0]
                  .target_from_body.rotation.w(),
              1, 1e-12);
}

TEST(CommaRows, MoreColumnsAreNotEurocAlone) {
  const TempDir dir;
  for (const char* more : {",", ",,", ",0.5"}) {
    const Trajectory trajectory = ReadTrajectory(dir.Write("odometry.csv", CurveRows(false, more)));
    ASSERT_EQ(trajectory.poses.size(), 40u) << more;
    EXPECT_NEAR(trajectory.poses[10].target_from_body.rotation.w(), std::cos(0.25), 1e-5) << more;
  }
  // All of EuRoC's columns, at rest.
  const auto state = dir.Write("state.csv", "1403636580838555648,1,2,3,0.8,0.6,0,0,1,2,3,4,5,6,7,8,9\n");
  EXPECT_DOUBLE_EQ(ReadTrajectory(state).poses[0].target_from_body.rotation.w(), 0.8);
}

TEST(CommaRows, OnlyAHeaderOfAllColumnsDecides) {
  const TempDir dir;
  const auto w_of_blanks = [&](const std::string& comment) {
    const auto file = dir.Write("odometry.tum", "# " + comment + "\n1 0 0 0 0.6 0 0 0.8\n");
    return ReadTrajectory(file).poses[0].target_from_body.rotation.w();
  };
  EXPECT_DOUBLE_EQ(w_of_blanks("quaternion order w x y z"), 0.8);
  EXPECT_DOUBLE_EQ(w_of_blanks("qw is the last"), 0.8);
  EXPECT_DOUBLE_EQ(w_of_blanks("(t, x, y, z, q_w, q_x, q_y, q_z)"), 0.6);
  const auto viewed = dir.Write("odometry.csv", "# made by qview\n" + CurveRows(true));
  EXPECT_NEAR(ReadTrajectory(viewed).poses[10].target_from_body.rotation.w(), std::cos(0.25), 1e-5);
  EXPECT_THAT(MessageOf<InputError>([&] { w_of_blanks("t x y z qz qy qx qw"); }), HasSubstr("in the order zyxw"));
}

TEST(CommaRows, AnOrderThatTheMotionDoesNotShowIsRefused) {
  const TempDir dir;
  std::string straight;
  for (int i = 0; i < 40; ++i) straight += std::to_string(i) + "," + std::to_string(i) + ",0,0,0,0,0,1\n";
  for (const std::string& text : {straight, std::string("1,0,0,0,0,0,0,1\n")}) {
    EXPECT_THAT(MessageOf<InputError>([&] { ReadTrajectory(dir.Write("odometry.csv", text)); }),
                HasSubstr("expected a header line such as 'timestamp,tx,ty,tz,qx,qy,qz,qw'"));
  }
  EXPECT_THAT(MessageOf<InputError>([&] { ReadTrajectory(dir.Write("de.tum", "1,5 2,5 0 0 0 0 0 1\n")); }),
              HasSubstr("de.tum:1: found numbers with a decimal comma; expected a dot"));
}

TEST(Kitti, TakesItsTimesFromAside) {
  const TempDir dir;
  const auto poses =
      dir.Write("00.txt", "1 0 0 1 0 1 0 2 0 0 1 3\n0 0 1 4 0 1 0 5 -1 0 0 6\n1 0 0 0 0 1 0 0 0 0 9 0\n");
  const Trajectory trajectory = ReadKittiTrajectory(poses, dir.Write("times.txt", "0.0\n1.036224e-01\n0.2\n"));
  ASSERT_EQ(trajectory.poses.size(), 2u);
  EXPECT_EQ(trajectory.poses[1].stamp_ns, 103'622'400);
  EXPECT_EQ(trajectory.poses[1].target_from_body.translation, Eigen::Vector3d(4, 5, 6));
  EXPECT_NEAR(
      (trajectory.poses[1].target_from_body.rotation * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitZ()).norm(), 0,
      1e-12);
  EXPECT_THAT(Joined(trajectory.warnings), HasSubstr("00.txt:3: the matrix holds no rotation"));
  EXPECT_THAT(MessageOf<InputError>([&] { ReadKittiTrajectory(poses, dir.Write("t2.txt", "0\n")); }),
              HasSubstr("3 poses, but"));
}

TEST(Tum, ComesBackAsWritten) {
  const TempDir dir;
  std::vector<TimedPose> poses;
  for (int i = 0; i < 50; ++i) {
    poses.push_back({1'700'000'000'000'000'000 + i * 33'333'333,
                     {ExpSO3(Eigen::Vector3d(0.1 * i, -0.05 * i, 0.02)), {0.1 * i, -1e3, 1e-9 * i}}});
  }
  WriteTum(dir / "t.tum", poses, {"one", "two"});
  EXPECT_TRUE(ReadTextFile(dir / "t.tum").starts_with("# one\n# two\n1700000000.000000000 0.000000000 "));
  const Trajectory back = ReadTrajectory(dir / "t.tum");
  ASSERT_EQ(back.poses.size(), poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(back.poses[i].stamp_ns, poses[i].stamp_ns);
    EXPECT_LT(back.poses[i].target_from_body.Minus(poses[i].target_from_body).norm(), 2e-9);
  }
}

TEST(Trajectory, InterpolatesOnlyWhereItKnows) {
  Trajectory trajectory;
  for (int64_t s : {0, 1, 2, 10}) {
    trajectory.poses.push_back(
        {s * kSecond, {ExpSO3(Eigen::Vector3d(0, 0, 0.1 * static_cast<double>(s))), {static_cast<double>(s), 0, 0}}});
  }
  const auto middle = trajectory.At(kSecond + kSecond / 4, kSecond);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->translation.x(), 1.25, 1e-12);
  EXPECT_NEAR(LogSO3(middle->rotation).z(), 0.125, 1e-12);
  EXPECT_FALSE(trajectory.At(5 * kSecond, kSecond));  // in the gap
  EXPECT_TRUE(trajectory.At(5 * kSecond, 8 * kSecond));
  EXPECT_TRUE(trajectory.At(10 * kSecond, 1));  // a pose itself
  EXPECT_FALSE(trajectory.At(-1, kSecond));
  EXPECT_FALSE(trajectory.At(10 * kSecond + 1, 100 * kSecond));
  EXPECT_FALSE(Trajectory().At(0, kSecond));
}

}  // namespace
}  // namespace trigpoint
