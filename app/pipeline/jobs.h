// Many results in one go: which ones, in which order, and what became of each.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "app/pipeline/stages.h"

namespace trigpoint {

// One result to be made.
struct Job {
  const StageInfo* stage = nullptr;
  StageTarget target;
  std::string Title() const;  // "localize/run1@paper"
};

// What is wanted.
struct JobQuery {
  std::vector<std::string> stages;  // with everything they need; empty: all stages
  std::vector<std::string> runs;    // empty: all of the project
  std::vector<std::string> variants = {""};
  nlohmann::json overrides = nlohmann::json::object();
};

// In an order in which each comes after those it needs. Throws InputError for a run the project doesn't have.
std::vector<Job> PlanJobs(const Project& project, const JobQuery& query);
// The first set of results, the variants of trigpoint.yaml, and those that are in the results folder.
std::vector<std::string> KnownVariants(const Project& project);

// The seed that the first of them with a result was made with; 1 without any.
uint64_t SeedOf(const Project& project, const std::vector<Job>& jobs);
// What lies in a folder of results, without hidden names.
std::set<std::string> ResultsIn(const std::filesystem::path& folder);

// What makes every result anew that rests on the review.
JobQuery ReviewQuery(const std::string& variant);

enum class JobEnd { kComputed, kUpToDate, kNotNeeded, kSkipped, kFailed };
// "computed", "up to date", "not needed", "skipped", "failed".
std::string_view JobEndName(JobEnd end);

struct JobResult {
  Job job;
  JobEnd end = JobEnd::kSkipped;
  std::string reason;  // why it failed, was skipped, or is not needed
  int exit_code = 0;   // of the error it failed with
  StageOutcome outcome;
};

// Runs them one after the other. A job that fails takes only those with it that need its result; a stage for all runs
// goes on with the runs that are there. Where results have limits, the stage `gates` judges them at the end, whatever
// became of the others. `begun` and `ended` are called around each. Throws Cancelled; and IoError at
// once if the project is locked or cannot be written.
struct JobCallbacks {
  std::function<void(const Job&)> begun = [](const Job&) {};
  std::function<void(const JobResult&)> ended = [](const JobResult&) {};
};
std::vector<JobResult> RunJobs(const Project& project, const std::vector<Job>& jobs, int threads, uint64_t seed,
                               ProgressSink& progress, const CancelToken& cancel, const JobCallbacks& callbacks = {});

struct JobState {
  Job job;
  StageState state = StageState::kMissing;
  std::string reason;  // of a failure; why a result is not needed
  bool needed = true;
  nlohmann::json manifest;  // of the result, null if there is none
};
// The state of each; one whose needs are not done is out of date itself. A variant that trigpoint.yaml doesn't name
// came from options on the command line: it is compared with what it was made of.
std::vector<JobState> StatesOf(const Project& project, const std::vector<Job>& jobs, uint64_t seed);

}  // namespace trigpoint
