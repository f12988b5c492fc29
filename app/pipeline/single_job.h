// Jobs one by one: what each waits for, and how one is run when the others are somebody else's.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "app/pipeline/jobs.h"

namespace trigpoint {

// What a job has to wait for among those before it in a plan.
struct JobNeeds {
  std::vector<size_t> needs;  // jobs whose results it reads
  std::vector<size_t> after;  // those and the others that must have ended, however: stages that read all that is there
};
std::vector<JobNeeds> NeedsOf(const Project& project, const std::vector<Job>& jobs);

// What becomes of a job that is not run: it is not needed, or too much of what it needs is not there. `needed`: what
// became of those whose results it reads.
std::optional<JobResult> EndWithoutRunning(const Project& project, const Job& job,
                                           const std::vector<JobResult>& needed);

struct JobAttempt {
  JobResult result;
  bool out_of_memory = false;  // it failed for lack of memory
};
// RunStage, or RunStageAsTask.
using StageRunner = std::function<StageOutcome(const Project&, const StageRequest&, int threads, uint64_t seed,
                                               ProgressSink&, const CancelToken&)>;
// Runs a job that is not ended without. Throws Cancelled.
JobAttempt RunJob(const Project& project, const Job& job, int threads, uint64_t seed, ProgressSink& progress,
                  const CancelToken& cancel, const StageRunner& run);

}  // namespace trigpoint
