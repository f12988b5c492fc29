// Do a run's images have odometry's times? By a reconstruction that is solved.
#pragma once

#include <optional>

#include "datasets/io/site.h"
#include "datasets/project/stage.h"
#include "localize/reconstruct/clock_error.h"
#include "localize/reconstruct/reconstruct_run.h"

namespace trigpoint {

// How late all images are against odometry, as far as it is significant. A correction that has `begun` goes on until
// little of it is left, as each estimate is of first order.
std::optional<ClockError> FindLateImages(const LocalizeInput& input, const Reconstruction& reconstruction,
                                         const ReconstructRunOptions& options, bool begun, const StageContext& context);

// Warns that the times of `run`'s odometry were corrected by `late_s`, and adds it to the metrics.
void SayLate(const Run& run, double late_s, double sigma_s, StageContext& context);

// Throws RefusedInput for images that have other times than odometry (no correction of it helped), than those of the
// other cameras, or than those of the run's first part.
void RequireOneClock(const Run& run, const LocalizeInput& input, const Reconstruction& reconstruction,
                     const ReconstructRunOptions& options, const StageContext& context);

}  // namespace trigpoint
