// A stage run by one of several processes that work in a project together.
#pragma once

#include "datasets/project/stage.h"

namespace trigpoint {

// As RunStage, but holds the project together with other tasks (TaskLock) while it makes its result.
StageOutcome RunStageAsTask(const Project& project, const StageRequest& request, int threads, uint64_t seed,
                            ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
