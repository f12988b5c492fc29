#include "eval/trajectory/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "calib/base/error.h"
#include "calib/estimation/random.h"
#include "datasets/io/site.h"
#include "tests/eval/shared_data.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

using ::testing::HasSubstr;
constexpr double kTolerance = 1e-6;

// A lively path: positions and attitudes that no two pieces share.
Rigid3d PoseAt(double t) {
  return {ExpSO3({0.3 * std::sin(t), 0.2 * std::cos(0.7 * t), 0.5 * t}),
          {3 * std::sin(0.6 * t) + t, 2 * std::cos(0.9 * t), 0.3 * std::sin(1.7 * t)}};
}

Trajectory PathOf(int n, double interval_s, double begin_s = 0) {
  Trajectory trajectory;
  for (int i = 0; i < n; ++i) {
    const double t = begin_s + i * interval_s;
    trajectory.poses.push_back({static_cast<int64_t>(std::llround(t * 1e9)), PoseAt(t)});
  }
  return trajectory;
}

Trajectory Transformed(const Sim3d& target_from_source, Trajectory trajectory) {
  for (TimedPose& pose : trajectory.poses) {
    pose.target_from_body = target_from_source.TransformPose(pose.target_from_body);
  }
  return trajectory;
}

TEST(Associate, TakesTheNearestForEachPoseOfTheShorter) {
  Trajectory reference = PathOf(11, 0.1), estimate = PathOf(4, 0.3, 0.004);
  const auto pairs = Associate(reference, estimate);
  ASSERT_EQ(pairs.size(), 4u);
  EXPECT_EQ(pairs[1].stamp_ns, 300'000'000);
  EXPECT_EQ(Associate(estimate, reference).size(), 4u);
  EXPECT_EQ(Associate(reference, estimate, {.max_difference_s = 0.02, .offset_s = 0.1})[0].stamp_ns, 100'000'000);
  try {
    Associate(reference, PathOf(4, 0.3, 50));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("0.000 to 1.000 s"));
    EXPECT_THAT(e.what(), HasSubstr("50.000 to 50.900 s"));
  }
}

TEST(Associate, AppliesALeverArm) {
  const Rigid3d mounting(ExpSO3({0.1, -0.2, 0.3}), {0.5, 0.1, 1.2});  // reference_body_from_estimate_body
  const Trajectory reference = PathOf(20, 0.1);
  Trajectory estimate = reference;
  for (TimedPose& pose : estimate.poses) pose.target_from_body = pose.target_from_body * mounting;
  const auto pairs = Associate(reference, estimate, {.estimate_body_from_reference_body = mounting.Inverse()});
  EXPECT_LT(StatisticsOf(AbsoluteErrors(pairs).translation_m).max, 1e-12);
  EXPECT_LT(StatisticsOf(AbsoluteErrors(pairs).rotation_deg).max, 1e-9);
}

TEST(Align, EveryKindRecoversItsTransform) {
  const Trajectory reference = PathOf(50, 0.1);
  const Eigen::Quaterniond yaw(Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitZ()));
  const Eigen::Quaterniond any = ExpSO3({0.4, -0.5, 2});
  const Eigen::Vector3d t(4e5, -3, 100);
  const std::vector<std::pair<TrajectoryAlignment, Sim3d>> cases{{TrajectoryAlignment::kNone, {}},
                                                                 {TrajectoryAlignment::kOrigin, {1, any, t}},
                                                                 {TrajectoryAlignment::kYaw, {1, yaw, t}},
                                                                 {TrajectoryAlignment::kSE3, {1, any, t}},
                                                                 {TrajectoryAlignment::kSim3, {1.7, any, t}}};
  for (const auto& [kind, source_from_target] : cases) {
    auto pairs = Associate(reference, Transformed(source_from_target, reference));
    const Sim3d fit = Align(&pairs, kind);
    EXPECT_NEAR(fit.scale * source_from_target.scale, 1, 1e-9) << ToString(kind);
    EXPECT_LT(StatisticsOf(AbsoluteErrors(pairs).translation_m).max, 1e-6) << ToString(kind);
    EXPECT_LT(StatisticsOf(AbsoluteErrors(pairs).rotation_deg).max, 1e-6) << ToString(kind);
    EXPECT_EQ(ParseTrajectoryAlignment(ToString(kind)), kind);
  }
  EXPECT_THROW(ParseTrajectoryAlignment("SE4"), OptionError);
}

TEST(RelativeErrors, DoNotDependOnTheEstimatesFrame) {
  const Trajectory reference = PathOf(200, 0.1);
  Random random(2);
  Trajectory estimate = reference;
  for (TimedPose& pose : estimate.poses) {
    pose.target_from_body.translation += 0.01 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
  }
  const Sim3d moved{1, ExpSO3({1, 2, 3}), {5, 6, 7}};
  for (const auto unit : {DeltaUnit::kFrames, DeltaUnit::kMetres, DeltaUnit::kSeconds}) {
    for (const bool all : {false, true}) {
      const RelativeOptions options{.delta = 2, .unit = unit, .all_pairs = all};
      const auto a = RelativeErrors(Associate(reference, estimate), options);
      const auto b = RelativeErrors(Associate(reference, Transformed(moved, estimate)), options);
      ASSERT_FALSE(a.translation_m.empty());
      ASSERT_EQ(a.translation_m.size(), b.translation_m.size());
      for (size_t i = 0; i < a.translation_m.size(); ++i) EXPECT_NEAR(a.translation_m[i], b.translation_m[i], 1e-9);
    }
  }
  EXPECT_THROW(RelativeErrors(Associate(reference, estimate), {.delta = 0}), OptionError);
  EXPECT_TRUE(
      RelativeErrors(Associate(reference, estimate), {.delta = 1e6, .unit = DeltaUnit::kMetres}).stamps_ns.empty());
}

TEST(RelativeErrors, PiecesHaveTheirLength) {
  const auto pairs = Associate(PathOf(101, 0.1), PathOf(101, 0.1));
  EXPECT_EQ(RelativeErrors(pairs, {.delta = 10}).stamps_ns.size(), 10u);
  EXPECT_EQ(RelativeErrors(pairs, {.delta = 10, .all_pairs = true}).stamps_ns.size(), 91u);
  EXPECT_EQ(RelativeErrors(pairs, {.delta = 0.95, .unit = DeltaUnit::kSeconds}).stamps_ns.size(), 10u);
  EXPECT_EQ(RelativeErrors(pairs, {.delta = 2, .unit = DeltaUnit::kSeconds, .all_pairs = true}).stamps_ns.size(),
            82u + 1u);
}

TEST(EstimateTimeOffset, FindsAClockThatIsATenthOfASecondOff) {
  const Trajectory reference = PathOf(400, 0.05);
  Random random(4);
  Trajectory estimate = Transformed({1, ExpSO3({0, 0, 1}), {1, 2, 3}}, PathOf(150, 0.1, 2));
  for (TimedPose& pose : estimate.poses) {
    pose.target_from_body.translation += 0.03 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
  }
  const auto none = EstimateTimeOffset(reference, estimate);
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->significant);
  EXPECT_LT(std::abs(none->offset_s), 4 * none->sigma_s);
  for (TimedPose& pose : estimate.poses) pose.stamp_ns += 100'000'000;
  const auto found = EstimateTimeOffset(reference, estimate);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->significant);
  EXPECT_NEAR(found->offset_s, -0.1, 4 * found->sigma_s);
  EXPECT_LT(found->sigma_s, 0.02);
  EXPECT_FALSE(EstimateTimeOffset(reference, PathOf(10, 0.1, 1000)));
}

TEST(EvaluateTrajectory, ReportsAndFormats) {
  const Trajectory reference = PathOf(100, 0.1);
  Trajectory estimate = PathOf(50, 0.2);
  for (TimedPose& pose : estimate.poses) pose.target_from_body.translation.x() += 0.3048;
  TrajectoryReportOptions options;
  options.relative = {{.delta = 1e9, .unit = DeltaUnit::kMetres}};
  const TrajectoryReport report = EvaluateTrajectory("ours", reference, estimate, options);
  EXPECT_EQ(report.pairs, 50);
  EXPECT_NEAR(report.ate_m.rmse, 0.3048, 1e-12);
  EXPECT_FALSE(report.rpe.at(0).m);
  EXPECT_THAT(FormatTrajectoryReports({report}, options, "ft", 0.3048),
              HasSubstr("| ours     |  ATE ft |  50 | 1.0000 |"));
  EXPECT_EQ(TrajectoryReportsJson({report}, options).at("schema"), "trigpoint trajectory 1");
}

class TrajectoryFile : public ::testing::Test {
 protected:
  PoseSequence Read(const std::string& text) const { return ReadPoseSequence(dir_.Write("poses", text)); }
  std::string Message(const std::string& text) const {
    return MessageOf<InputError>([&] { Read(text); });
  }
  TempDir dir_;
};

TEST_F(TrajectoryFile, ReadsTumEurocAndKitti) {
  const PoseSequence tum = Read("# time x y z q\n1.5 1 2 3 0 0 1 0\n0.5 4 5 6 0 0 0 1\n0.5 4 5 6 0 0 0 1\n");
  EXPECT_EQ(tum.stamps_ns, (std::vector<int64_t>{500'000'000, 500'000'000, 1'500'000'000}));
  EXPECT_NEAR(tum.poses[2].rotation(0, 0), -1, 1e-12);
  ASSERT_EQ(tum.warnings.size(), 2u);
  EXPECT_THAT(tum.warnings[0], HasSubstr("out of order"));
  EXPECT_THAT(tum.warnings[1], HasSubstr("1 timestamps stand twice"));
  const PoseSequence euroc = Read("#timestamp, x, y, z, qw, qx, qy, qz, v\n1403715524907143168,1,2,3,0,0,0,1,9\n");
  EXPECT_EQ(euroc.stamps_ns[0], 1403715524907143168);
  EXPECT_NEAR(euroc.poses[0].rotation(0, 0), -1, 1e-12);
  const PoseSequence kitti = Read("1 0 0 7 0 1 0 8 0 0 1 9\n");
  EXPECT_FALSE(kitti.HasTimes());
  EXPECT_EQ(kitti.poses[0].translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(Associate(kitti, kitti).size(), 1u);
  EXPECT_THROW(Associate(kitti, tum), InputError);
}

TEST_F(TrajectoryFile, TheOrderOfRowsWithCommasIsFound) {
  const PoseSequence named = Read("#timestamp,tx,ty,tz,qx,qy,qz,qw\n1,1,2,3,0.6,0,0,0.8\n");
  EXPECT_NEAR(named.poses[0].rotation(1, 1), 0.28, 1e-12);
  std::string curve;
  for (int i = 0; i < 40; ++i) {
    const double a = 0.05 * i;
    const std::string at = std::to_string(20 * std::sin(a)) + "," + std::to_string(20 * (1 - std::cos(a)));
    curve += std::to_string(i) + "," + at + ",0,0,0," + std::to_string(std::sin(a / 2)) + "," +
             std::to_string(std::cos(a / 2)) + "\n";
  }
  EXPECT_NEAR(Read(curve).poses[10].rotation(1, 0), std::sin(0.5), 1e-5);
  EXPECT_THAT(Message("1,0,0,0,0,0,0,1\n"), HasSubstr("does not show whether the quaternion's w comes first"));
}

TEST_F(TrajectoryFile, NamesLineExpectedAndFound) {
  EXPECT_THAT(Message(""), HasSubstr("found no pose"));
  EXPECT_THAT(Message("1 2 3\n"), HasSubstr(":1: expected 8 numbers (TUM)"));
  EXPECT_THAT(Message("1 0 0 0 0 0 0 1\n2 0 0\n"), HasSubstr(":2: expected 8 fields"));
  EXPECT_THAT(Message("1 0 nan 0 0 0 0 1\n"), HasSubstr("field 3 is 'nan'"));
  EXPECT_THAT(Message("1 0 0 0 0 0 0 2\n"), HasSubstr("unit quaternion"));
  EXPECT_THAT(Message("soon 0 0 0 0 0 0 1\n"), HasSubstr(":1: expected a time"));
  EXPECT_THAT(Message("1 1 0 7 0 1 0 8 0 0 1 9\n"), HasSubstr("no rotation"));
  EXPECT_THROW(ReadPoseSequence("/nonexistent"), InputError);
}

// evo's own numbers, where its test data is at hand.
class Evo : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto dir = SharedData("trajectories");
    if (!dir) GTEST_SKIP() << "no trajectories at hand";
    dir_ = *dir;
    expected_ = nlohmann::json::parse(std::ifstream(dir_ / "expected_evo.json"));
  }
  static void Compare(const nlohmann::json& expected, const SampleStatistics& found, const std::string& what) {
    const std::map<std::string, double> values{{"rmse", found.rmse}, {"mean", found.mean}, {"median", found.median},
                                               {"std", found.std},   {"min", found.min},   {"max", found.max}};
    for (const auto& [name, value] : values) {
      EXPECT_NEAR(value, expected.at(name).get<double>(), kTolerance) << what << ": " << name;
    }
    const double sse = expected.at("sse").get<double>();
    EXPECT_NEAR(found.sse, sse, kTolerance * std::max(1.0, sse)) << what << ": sse";
  }
  void CompareAbsolute(const std::string& key, const PoseSequence& reference, const PoseSequence& estimate,
                       TrajectoryAlignment alignment) const {
    ASSERT_TRUE(expected_.contains(key)) << key;
    const nlohmann::json& expected = expected_.at(key);
    auto pairs = Associate(reference, estimate);
    ASSERT_EQ(pairs.size(), expected.at("n_pairs").get<size_t>()) << key;
    const Sim3d fit = Align(&pairs, alignment);
    const TrajectoryErrors errors = AbsoluteErrors(pairs);
    Compare(expected.at("APE_translation_part"), StatisticsOf(errors.translation_m), key);
    Compare(expected.at("APE_rotation_angle_deg"), StatisticsOf(errors.rotation_deg), key + " (deg)");
    if (!expected.contains("alignment")) return;
    EXPECT_NEAR(fit.scale, expected["alignment"]["s"].get<double>(), kTolerance) << key;
    const Eigen::Matrix3d r = fit.rotation.toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(fit.translation[i], expected["alignment"]["t"][static_cast<size_t>(i)].get<double>(), kTolerance)
          << key;
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(r(i, j), expected["alignment"]["R"][static_cast<size_t>(i)][static_cast<size_t>(j)].get<double>(),
                    kTolerance)
            << key;
      }
    }
  }
  void CompareRelative(const std::string& key, const PoseSequence& reference, const PoseSequence& estimate,
                       TrajectoryAlignment alignment, const RelativeOptions& options) const {
    ASSERT_TRUE(expected_.contains(key)) << key;
    const nlohmann::json& expected = expected_.at(key);
    auto pairs = Associate(reference, estimate);
    Align(&pairs, alignment);
    const TrajectoryErrors errors = RelativeErrors(pairs, options);
    ASSERT_EQ(errors.translation_m.size(), expected.at("n_translation_part").get<size_t>()) << key;
    Compare(expected.at("RPE_translation_part"), StatisticsOf(errors.translation_m), key);
    Compare(expected.at("RPE_rotation_angle_deg"), StatisticsOf(errors.rotation_deg), key + " (deg)");
  }
  std::filesystem::path dir_;
  nlohmann::json expected_;
};

TEST_F(Evo, Tum) {
  for (const auto& [reference_file, estimates] : std::map<std::string, std::vector<std::string>>{
           {"freiburg1_xyz-groundtruth.txt",
            {"freiburg1_xyz-rgbdslam.txt", "freiburg1_xyz-rgbdslam_drift.txt", "freiburg1_xyz-ORB_kf_mono.txt"}},
           {"fr2_desk_groundtruth.txt", {"fr2_desk_ORB.txt", "fr2_desk_ORB_kf_mono.txt"}}}) {
    const PoseSequence reference = ReadPoseSequence(dir_ / reference_file);
    for (const std::string& name : estimates) {
      const PoseSequence estimate = ReadPoseSequence(dir_ / name);
      const std::string key = name + " | ref " + reference_file + " | t_max_diff 0.01 | ";
      CompareAbsolute(key + "SE3 align", reference, estimate, TrajectoryAlignment::kSE3);
      CompareAbsolute(key + "Sim3 align", reference, estimate, TrajectoryAlignment::kSim3);
      CompareAbsolute(key + "no align", reference, estimate, TrajectoryAlignment::kNone);
      CompareRelative(name + " | RPE delta 1 frame consecutive | SE3 align", reference, estimate,
                      TrajectoryAlignment::kSE3, {.delta = 1});
      CompareRelative(name + " | RPE delta 1 m consecutive | Sim3 align", reference, estimate,
                      TrajectoryAlignment::kSim3, {.delta = 1, .unit = DeltaUnit::kMetres});
    }
  }
}

TEST_F(Evo, Kitti) {
  const PoseSequence reference = ReadPoseSequence(dir_ / "KITTI_00_gt.txt");
  for (const std::string name : {"KITTI_00_ORB.txt", "KITTI_00_SPTAM.txt"}) {
    const PoseSequence estimate = ReadPoseSequence(dir_ / name);
    CompareAbsolute(name + " | KITTI format | SE3 align", reference, estimate, TrajectoryAlignment::kSE3);
    CompareAbsolute(name + " | KITTI format | Sim3 align", reference, estimate, TrajectoryAlignment::kSim3);
    CompareAbsolute(name + " | KITTI format | no align", reference, estimate, TrajectoryAlignment::kNone);
    CompareRelative(name + " | RPE delta 1 frame no align", reference, estimate, TrajectoryAlignment::kNone,
                    {.delta = 1});
    CompareRelative(name + " | RPE delta 10 m consecutive no align", reference, estimate, TrajectoryAlignment::kNone,
                    {.delta = 10, .unit = DeltaUnit::kMetres});
    CompareRelative(name + " | RPE delta 100 m all_pairs no align", reference, estimate, TrajectoryAlignment::kNone,
                    {.delta = 100, .unit = DeltaUnit::kMetres, .all_pairs = true});
  }
}

TEST_F(Evo, EuRoC) {
  const PoseSequence reference = ReadPoseSequence(dir_ / "V102_groundtruth.csv");
  const PoseSequence estimate = ReadPoseSequence(dir_ / "V102.txt");
  CompareAbsolute("V102.txt | EuRoC csv gt | SE3 align", reference, estimate, TrajectoryAlignment::kSE3);
  CompareAbsolute("V102.txt | EuRoC csv gt | Sim3 align", reference, estimate, TrajectoryAlignment::kSim3);
}

TEST_F(Evo, BigCoordinatesKeepTheirDigits) {
  const PoseSequence reference = ReadPoseSequence(dir_ / "georeferenced.tum");
  auto pairs = Associate(reference, reference);
  Align(&pairs, TrajectoryAlignment::kSE3);
  EXPECT_LT(StatisticsOf(AbsoluteErrors(pairs).translation_m).max, 1e-6);
}

// Rendered runs against their true poses; expected numbers by an independent program (numpy).
TEST(Trajectory, ScoresOdometryOfTheRenderedLot) {
  const auto lot = SharedData("lot_a"), truth_dir = SharedData("lot_a_truth");
  if (!lot || !truth_dir) GTEST_SKIP() << "no rendered lot at hand";
  const PoseSequence truth = ReadPoseSequence(*truth_dir / "runs/run1_cameras.tum");
  const PoseSequence odometry = ReadPoseSequence(*lot / "runs/run1/odometry.tum");
  const auto run = ReadRun(*lot / "runs/run1", *lot);
  const Rigid3d body_from_cam = run.cameras.at(0).cam_from_body.Inverse();
  const auto pairs = Associate(truth, odometry, {.estimate_body_from_reference_body = body_from_cam});
  EXPECT_EQ(pairs.size(), 258u);
  EXPECT_NEAR(PathLength(pairs), 127.70964759213011, kTolerance);
  auto rigid = pairs, similar = pairs;
  Align(&rigid, TrajectoryAlignment::kSE3);
  EXPECT_NEAR(StatisticsOf(AbsoluteErrors(rigid).translation_m).rmse, 0.39285550841414024, kTolerance);
  const Sim3d fit = Align(&similar, TrajectoryAlignment::kSim3);
  EXPECT_NEAR(StatisticsOf(AbsoluteErrors(similar).translation_m).rmse, 0.2922394645924975, kTolerance);
  EXPECT_NEAR(1 / fit.scale - 1, -0.013393362379811813, kTolerance);
}

}  // namespace
}  // namespace trigpoint
