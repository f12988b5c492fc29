#include "app/pipeline/jobs.h"

#include <gmock/gmock.h>

#include "app/pipeline/single_job.h"
#include "datasets/project/reference_parts.h"
#include "tests/support/project_folder.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;

struct ToyOptions {
  int size = 1;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.size, {"size", "", 1, 10});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

StageInfo ToyStage(const std::string& name, std::vector<std::string> needs, bool per_run, bool variants) {
  StageInfo info;
  info.name = name;
  info.needs = std::move(needs);
  info.per_run = per_run;
  info.variants = variants;
  UseOptions<ToyOptions>(info);
  info.make = [](const Project&, const StageTarget&) {
    StageRequest request;
    request.body = [](StageContext&) {};
    return request;
  };
  return info;
}

// first (per run) <- second (per run, variants) <- all (one for all runs, variants)
class JobsTest : public testing::Test {
 protected:
  JobsTest() : project_(Project::Open(folder_.dir())) {
    for (const char* run : {"run1", "run2"}) jobs_.push_back({&first_, {run, "", {}}});
    for (const char* run : {"run1", "run2"}) jobs_.push_back({&second_, {run, "", {}}});
    jobs_.push_back({&all_, {"", "", {}}});
  }
  // "first/run1 computed", ...
  std::vector<std::string> Run() {
    std::vector<std::string> ends;
    for (const JobResult& result : RunJobs(project_, jobs_, 1, 1, progress_, cancel_)) {
      ends.push_back(result.job.Title() + " " + std::string(JobEndName(result.end)));
    }
    return ends;
  }
  std::vector<std::string> States() {
    std::vector<std::string> states;
    for (const JobState& state : StatesOf(project_, jobs_, 1)) {
      states.push_back(state.job.Title() + " " + std::string(StageStateName(state.state)));
    }
    return states;
  }
  void FailFor(StageInfo& stage, const std::string& run) {
    stage.make = [run](const Project&, const StageTarget& target) {
      StageRequest request;
      request.version = 2;
      const bool fails = target.run == run;
      request.body = [fails](StageContext&) {
        if (fails) throw InputError("nothing to see");
      };
      return request;
    };
  }

  ProjectFolder folder_;
  Project project_;
  StageInfo first_ = ToyStage("first", {}, true, false);
  StageInfo second_ = ToyStage("second", {"first"}, true, true);
  StageInfo all_ = ToyStage("all", {"second"}, false, true);
  std::vector<Job> jobs_;
  ProgressSink progress_;
  CancelToken cancel_;
};

TEST_F(JobsTest, ComputesInOrderAndOnlyOnce) {
  EXPECT_THAT(Run(), ElementsAre("first/run1 computed", "first/run2 computed", "second/run1 computed",
                                 "second/run2 computed", "all computed"));
  EXPECT_THAT(Run(), ElementsAre("first/run1 up to date", "first/run2 up to date", "second/run1 up to date",
                                 "second/run2 up to date", "all up to date"));
  EXPECT_THAT(States(),
              ElementsAre("first/run1 done", "first/run2 done", "second/run1 done", "second/run2 done", "all done"));
}

TEST_F(JobsTest, OneRunsFailureStopsOnlyWhatNeedsIt) {
  FailFor(first_, "run1");
  EXPECT_THAT(Run(), ElementsAre("first/run1 failed", "first/run2 computed", "second/run1 skipped",
                                 "second/run2 computed", "all computed"));
  EXPECT_THAT(States(), ElementsAre("first/run1 failed", "first/run2 done", "second/run1 missing", "second/run2 done",
                                    "all out of date"));
}

TEST_F(JobsTest, AnEarlierResultIsNotUsedSilently) {
  Run();
  FailFor(second_, "run1");
  class Sink : public ProgressSink {
   public:
    void Log(LogLevel, std::string_view text) override { lines.emplace_back(text); }
    std::vector<std::string> lines;
  } sink;
  RunJobs(project_, jobs_, 1, 1, sink, cancel_);
  EXPECT_THAT(sink.lines, testing::Contains("all: second/run1 failed, its earlier result is used"));
}

TEST_F(JobsTest, NothingLeftMeansSkipped) {
  jobs_.erase(jobs_.begin() + 3);
  jobs_.erase(jobs_.begin() + 1);
  FailFor(first_, "run1");
  EXPECT_THAT(Run(), ElementsAre("first/run1 failed", "second/run1 skipped", "all skipped"));
}

TEST_F(JobsTest, WhatIsOutOfDateMakesWhatFollowsOutOfDate) {
  Run();
  FailFor(first_, "");
  EXPECT_THAT(States(), ElementsAre("first/run1 out of date", "first/run2 out of date", "second/run1 out of date",
                                    "second/run2 out of date", "all out of date"));
}

TEST_F(JobsTest, WhatIsMadeOnRequestIsNotMissed) {
  Run();
  StageInfo extra = ToyStage("extra", {"second"}, false, true);
  all_.needs = {"second", "extra"};
  jobs_.insert(jobs_.end() - 1, {&extra, {"", "", {}}});
  EXPECT_EQ(States().back(), "all out of date");
  extra.first_on_request = true;
  EXPECT_EQ(States().back(), "all done");
}

TEST_F(JobsTest, NotNeededIsNoFailure) {
  second_.not_needed = [](const Project&, const StageTarget&) { return "no panoramas"; };
  EXPECT_THAT(Run(), ElementsAre("first/run1 computed", "first/run2 computed", "second/run1 not needed",
                                 "second/run2 not needed", "all computed"));
}

TEST_F(JobsTest, VariantsLieBesideAndShareWhatHasNone) {
  jobs_ = {{&first_, {"run1", "x", {}}}, {&second_, {"run1", "x", {}}}, {&all_, {"", "x", {}}}};
  EXPECT_THAT(Run(), ElementsAre("first/run1 computed", "second/run1@x computed", "all@x computed"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "results/second/run1@x/manifest.json"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "results/all@x/manifest.json"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "results/first/run1/manifest.json"));
}

TEST_F(JobsTest, LockedProjectEndsAllAtOnce) {
  const Project other = Project::Open(folder_.dir());
  const auto lock = other.Lock();
  EXPECT_THAT(MessageOf<IoError>([&] { Run(); }), testing::HasSubstr("in use by process"));
}

TEST_F(JobsTest, CancelledIsNoFailure) {
  cancel_.Cancel();
  EXPECT_THROW(Run(), Cancelled);
}

// "second/run1: first/run1" of what each job needs, and of what else it comes after.
std::vector<std::string> NeedsIn(const Project& project, const std::vector<Job>& jobs, bool after) {
  std::vector<std::string> lines;
  const std::vector<JobNeeds> all = NeedsOf(project, jobs);
  for (size_t i = 0; i < jobs.size(); ++i) {
    std::string line = jobs[i].Title().append(":");
    for (const size_t k : after ? all[i].after : all[i].needs) line.append(" ").append(jobs[k].Title());
    lines.push_back(line);
  }
  return lines;
}

TEST_F(JobsTest, AJobNeedsTheResultsThatItReads) {
  const std::vector<std::string> needs = {"first/run1:", "first/run2:", "second/run1: first/run1",
                                          "second/run2: first/run2", "all: second/run1 second/run2"};
  EXPECT_EQ(NeedsIn(project_, jobs_, false), needs);
  EXPECT_EQ(NeedsIn(project_, jobs_, true), needs);
}

TEST_F(JobsTest, AJobNeedsTheResultsOfItsVariant) {
  jobs_ = {{&first_, {"run1", "", {}}},
           {&second_, {"run1", "", {}}},
           {&second_, {"run1", "x", {}}},
           {&all_, {"", "", {}}},
           {&all_, {"", "x", {}}}};
  EXPECT_THAT(NeedsIn(project_, jobs_, false),
              ElementsAre("first/run1:", "second/run1: first/run1", "second/run1@x: first/run1", "all: second/run1",
                          "all@x: second/run1@x"));
  // One that sets none of the options reads the first set's.
  second_.read_as = [](const Project&, const std::string& reader, const StageTarget& target) {
    EXPECT_EQ(reader, "all");
    StageTarget read = target;
    read.variant.clear();
    return read;
  };
  EXPECT_THAT(NeedsIn(project_, jobs_, false),
              ElementsAre("first/run1:", "second/run1: first/run1", "second/run1@x: first/run1", "all: second/run1",
                          "all@x: second/run1"));
}

TEST_F(JobsTest, WhatReadsAllThatIsThereComesAfterAllOfIt) {
  const StageInfo stitch = ToyStage("stitch", {}, true, false), gates = ToyStage("gates", {"all"}, false, false);
  jobs_ = {
      {&stitch, {"S1", "", {}}}, {&first_, {"run1", "", {}}}, {&second_, {"run2", "", {}}}, {&gates, {"", "", {}}}};
  EXPECT_THAT(NeedsIn(project_, jobs_, false), ElementsAre("stitch/S1:", "first/run1:", "second/run2:", "gates:"));
  EXPECT_THAT(NeedsIn(project_, jobs_, true),
              ElementsAre("stitch/S1:", "first/run1: stitch/S1", "second/run2: stitch/S1",
                          "gates: stitch/S1 first/run1 second/run2"));
}

// Tags link the runs that are adjusted together, whatever else holds them.
TEST(SiteStageTest, HeedsTheReviewOfTags) {
  const ProjectFolder folder;
  const auto values = [&] { return MakeRequest(Project::Open(folder.dir()), StageNamed("site"), {"", "", {}}).values; };
  const nlohmann::json before = values();
  AppendReview(Project::Open(folder.dir()), {"exclude", "tag:1", "", "it was moved", "anna"});
  EXPECT_NE(values(), before);
}

TEST(PlanJobs, UnknownNamesComeWithTheNearest) {
  const ProjectFolder folder;
  const Project project = Project::Open(folder.dir());
  JobQuery query;
  query.runs = {"run11"};
  EXPECT_THAT(MessageOf<InputError>([&] { PlanJobs(project, query); }), testing::HasSubstr("nearest: 'run1'"));
  EXPECT_THAT(MessageOf<OptionError>([&] { StageNamed("lokalize"); }), testing::HasSubstr("unknown stage 'lokalize'"));
}

// Each part but the first reads the first one's result; whoever reads the stage reads all parts.
TEST_F(JobsTest, PartsWaitForTheFirstOne) {
  StageInfo parts = ToyStage("parts", {}, false, false);
  parts.parts = [](const Project&) { return std::vector<std::string>{"000of002", "001of002"}; };
  StageInfo reader = ToyStage("reader", {"parts"}, true, false);
  std::vector<Job> jobs;
  for (const std::string& part : parts.parts(project_)) {
    jobs.push_back({&parts, {}});
    jobs.back().target.part = part;
  }
  jobs.push_back({&reader, {"run1", "", {}}});
  EXPECT_EQ(jobs[1].Title(), "parts@001of002");
  const std::vector<JobNeeds> needs = NeedsOf(project_, jobs);
  EXPECT_THAT(needs[0].needs, ElementsAre());
  EXPECT_THAT(needs[1].needs, ElementsAre(0));
  EXPECT_THAT(needs[2].needs, ElementsAre(0, 1));
}

// Features are taken over from the parts of a former number until the present ones are there.
TEST_F(JobsTest, PartsOfAFormerNumberGoWhenThePresentOnesAreThere) {
  for (const char* name : {"@000of002", "@001of002", "@trial"}) {
    StageRequest request;
    request.stage = "references";
    request.name = name;
    request.body = [](StageContext& context) { std::ofstream(context.out / "features.db") << "features"; };
    RunStage(project_, request, 1, 1, progress_, cancel_);
  }
  folder_.Write("results/references@001of002/notes.txt", "mine");
  folder_.Write("results/references@000of004/notes.txt", "mine");
  const auto there = [&](const std::string& file) {
    return std::filesystem::exists(folder_ / ("results/references" + file));
  };
  folder_.Write("panoramas.csv", "file,station,latitude_deg,longitude_deg,height_m\np1.jpg,S1,48.0001,7.8001,241\n");
  folder_.Write("p1.jpg", "a picture");
  const Project project = Project::Open(folder_.dir());
  ASSERT_EQ(project.site().references.size(), 1u);
  RemoveFormerParts(project, progress_);
  EXPECT_TRUE(there("@000of002/features.db"));
  class Sink : public ProgressSink {
   public:
    void Log(LogLevel level, std::string_view text) override {
      if (level == LogLevel::kWarning) warnings.emplace_back(text);
    }
    std::vector<std::string> warnings;
  } sink;
  const StageInfo references = ToyStage("references", {}, false, false);
  jobs_.clear();
  jobs_.push_back({&references, {}});
  // Opened before the panorama was there, as if its disk were not mounted.
  ASSERT_TRUE(project_.site().references.empty());
  RunJobs(project_, jobs_, 1, 1, progress_, cancel_);
  EXPECT_TRUE(there("/manifest.json"));
  EXPECT_TRUE(there("@000of002/features.db"));
  RunJobs(project, jobs_, 1, 1, sink, cancel_);
  EXPECT_FALSE(there("@000of002"));
  // What a person put there stays, and is named.
  for (const char* file : {"@001of002/notes.txt", "@001of002/features.db", "@000of004/notes.txt"})
    EXPECT_TRUE(there(file)) << file;
  EXPECT_THAT(sink.warnings, ElementsAre(testing::HasSubstr("results/references@000of004: expected only what"),
                                         testing::HasSubstr("results/references@001of002: expected only what")));
  EXPECT_TRUE(there("@trial/features.db"));  // no part
}

}  // namespace
}  // namespace trigpoint
