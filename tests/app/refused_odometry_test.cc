// Odometry that follows other conventions: what rests on it is not computed.
#include <gmock/gmock.h>

#include "app/pipeline/jobs.h"
#include "app/pipeline/survey_input.h"
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

}  // namespace
}  // namespace trigpoint
