// What a localization found, in words and in numbers of its manifest.
#pragma once

#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/stage.h"
#include "datasets/solution/solution.h"
#include "localize/files/job.h"
#include "localize/localize.h"

namespace trigpoint {

// As published, references are panoramas. The photos of a hand-held set, each by itself, would take their places.
void LeaveOutSets(Site* site, ProgressSink& progress);

// Warns of what a reader should know (no georeference, heights, sources of geotags, clocks, focal lengths), completes
// the reasons why references have no answer, and adds to the context's metrics. `counts`: of the run's reconstruction.
void NoteLocalization(const Site& site, const Run& run, const LocalizeJob& job, const std::vector<SetRefinement>& sets,
                      const SolutionCounts& counts, Localization* result, StageContext& context);

}  // namespace trigpoint
