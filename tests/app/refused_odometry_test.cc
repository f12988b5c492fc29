// Odometry that follows other conventions: what rests on it is not computed, and `check` names how it is meant.
#include <gmock/gmock.h>

#include <cmath>

#include "app/pipeline/check_pairs.h"
#include "app/pipeline/jobs.h"
#include "app/pipeline/survey_input.h"
#include "calib/geometry/pose_readings.h"
#include "datasets/project/manifest.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Key;

class RefusedOdometry : public testing::Test {
 protected:
  Project Open() const { return Project::Open(folder_.dir()); }
  // As `reconstruct` fails for a run.
  template <typename Failure>
  void Fail(const std::string& run, const Failure& failure) {
    const Project project = Open();
    StageRequest request = MakeRequest(project, StageNamed("reconstruct"), {run, "", {}});
    request.body = [&](StageContext&) { throw failure; };
    EXPECT_THROW(RunStage(project, request, 1, 1, progress_, cancel_), InputError);
  }
  SurveyJob Job() {
    const Project project = Open();
    JobQuery query;
    query.stages = {"detect"};
    RunJobs(project, PlanJobs(project, query), 1, 1, progress_, cancel_);
    nlohmann::json metrics;
    StageContext context{project, folder_ / "out", 1, 1, progress_, cancel_, metrics};
    return MakeSurveyJob(project, {}, {}, context);
  }
  std::map<std::string, std::string> Refused(bool check = true) const {
    SurveyStageOptions options;
    options.map.check_conventions = check;
    return RunsOfRefusedOdometry(Open(), {}, options);
  }

  ProjectFolder folder_;
  ProgressSink progress_;
  CancelToken cancel_;
};

TEST_F(RefusedOdometry, TakesNoPartInTheSurvey) {
  EXPECT_EQ(Job().input.runs.size(), 2u);
  Fail("run1", RefusedInput("odometry", "odometry.tum: contradicts the images"));
  EXPECT_THAT(Refused(), ElementsAre(Key("run1")));
  const SurveyJob job = Job();
  ASSERT_EQ(job.input.runs.size(), 1u);
  EXPECT_EQ(job.input.runs[0].name, "run2");
  EXPECT_THAT(job.warnings,
              Contains(HasSubstr("run run1 takes no part, as `trigpoint reconstruct` refused its odometry: "
                                 "odometry.tum: contradicts the images")));
  Fail("run2", RefusedInput("odometry", "odometry.tum: contradicts the images"));
  EXPECT_THAT(MessageOf<InputError>([&] { Job(); }), HasSubstr("no run is left: run run1 takes no part"));
  EXPECT_TRUE(Refused(false).empty());
}

TEST_F(RefusedOdometry, IsForgottenWhenTheFileChanges) {
  Fail("run1", RefusedInput("odometry", "odometry.tum: contradicts the images"));
  folder_.Write("runs/run1/odometry.tum", "1.0 0 0 0 0 0 0 1\n2.0 2 0 0 0 0 0 1\n");
  EXPECT_TRUE(Refused().empty());
}

TEST_F(RefusedOdometry, OtherFailuresKeepTheRun) {
  Fail("run1", InputError("too few features"));
  EXPECT_TRUE(Refused().empty());
  EXPECT_EQ(Job().input.runs.size(), 2u);
}

// A body that turns about its up axis, and what pictures of a camera that looks forward show of it.
struct Turning {
  Turning() {
    Eigen::Matrix3d axes;
    axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    const Eigen::Quaterniond cam_from_body(axes);
    for (int k = 0; k < 24; ++k) {
      const Eigen::Quaterniond q(Eigen::AngleAxisd(0.15 * k + 0.02 * k * k, Eigen::Vector3d::UnitZ()) *
                                 Eigen::AngleAxisd(0.02 * (k % 3), Eigen::Vector3d::UnitY()));
      run.odometry.poses.push_back({k * 500'000'000LL, Rigid3d(q, {0.5 * k, 0, 0})});
    }
    for (size_t k = 1; k < run.odometry.poses.size(); ++k) {
      const auto &a = run.odometry.poses[k - 1], &b = run.odometry.poses[k];
      turns.push_back({a.stamp_ns, b.stamp_ns, cam_from_body,
                       cam_from_body * b.target_from_body.rotation.conjugate() * a.target_from_body.rotation *
                           cam_from_body.conjugate()});
    }
  }
  Run run;
  std::vector<MeasuredTurn> turns;
};

TEST(OtherReading, IsNamedByThePicturesRotations) {
  Turning right;
  EXPECT_EQ(FindOtherReading(right.run, right.turns, "odometry.tum"), std::nullopt);
  Turning w_first;
  for (TimedPose& pose : w_first.run.odometry.poses) {  // x y z w are read from w x y z
    const Eigen::Quaterniond q = pose.target_from_body.rotation;
    pose.target_from_body.rotation = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y());
  }
  EXPECT_THAT(FindOtherReading(w_first.run, w_first.turns, "odometry.tum").value_or(""),
              HasSubstr("if its quaternions are written w x y z (expected x y z w): reorder their columns"));
  EXPECT_EQ(FindOtherReading(right.run, right.turns, "odometry.tum"), std::nullopt);
  right.turns.resize(2);
  EXPECT_EQ(FindOtherReading(right.run, right.turns, "odometry.tum"), std::nullopt);
}

// A body that moves along x, with odometry that says the opposite; one of the motions is measured wrongly.
TEST(OtherReading, OneMotionDoesNotOutweighTheSimplerReading) {
  constexpr int kMotions = 12;
  std::vector<Rigid3d> poses;
  std::vector<MeasuredMotion> motions;
  for (int k = 0; k <= kMotions; ++k) poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-k, 0, 0));
  for (int k = 0; k < kMotions; ++k) {
    MeasuredMotion m;
    m.a = k, m.b = k + 1;
    m.b_from_a.translation = k + 1 < kMotions ? Eigen::Vector3d(-1, 0, 0) : Eigen::Vector3d(0, -1, 0);
    m.has_direction = true;
    motions.push_back(m);
  }
  PoseReading as_read, opposite, far_fetched;
  as_read.apply = [](const Rigid3d& p) { return p; };
  opposite.what = "opposite", opposite.changes = 1;
  opposite.apply = [](const Rigid3d& p) { return Rigid3d(p.rotation, -p.translation); };
  far_fetched.what = "far-fetched", far_fetched.changes = 2;
  far_fetched.apply = [](const Rigid3d& p) {
    const double x = -p.translation.x();
    return Rigid3d(p.rotation, {std::min(x, kMotions - 1.0), x > kMotions - 0.5 ? 1.0 : 0.0, 0});
  };
  const ReadingVerdict verdict = JudgeReadings(poses, motions, {as_read, opposite, far_fetched});
  ASSERT_EQ(verdict.better.size(), 1u);
  EXPECT_EQ(verdict.better[0].what, "opposite");
}

// A straight way shows no turns: the directions between pictures do.
TEST(OtherReading, IsNamedByTheDirectionsOfAStraightWay) {
  Turning straight;
  for (size_t k = 0; k < straight.run.odometry.poses.size(); ++k) {
    straight.run.odometry.poses[k].target_from_body = {
        Eigen::Quaterniond(Eigen::AngleAxisd(0.9, Eigen::Vector3d::UnitZ())),
        Eigen::Vector3d(std::cos(0.9), std::sin(0.9), 0) * (0.5 * static_cast<double>(k))};
  }
  for (MeasuredTurn& turn : straight.turns) {
    turn.b_from_a.setIdentity();
    turn.direction = -Eigen::Vector3d::UnitZ();  // of the camera, which looks ahead
    turn.sigma_direction_rad = 0.02;
  }
  EXPECT_EQ(FindOtherReading(straight.run, straight.turns, "odometry.tum"), std::nullopt);
  for (TimedPose& pose : straight.run.odometry.poses) {
    const Eigen::Quaterniond q = pose.target_from_body.rotation;
    pose.target_from_body.rotation = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y());
  }
  EXPECT_THAT(FindOtherReading(straight.run, straight.turns, "odometry.tum").value_or(""),
              HasSubstr("0 of 23 directions"));
}

}  // namespace
}  // namespace trigpoint
