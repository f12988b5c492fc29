// Scene points that tie a run's pictures together, for the survey.
#pragma once

#include <filesystem>

#include "localize/reconstruct_run.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// Tracks of features, reconstructed as `localize` does it, loops closed. Fills start, tie_points, ties and
// tie_loss_chi2 of `survey`. The longest tracks are kept, until every picture has `ties_per_image`. Throws InputError
// where the run has no odometry or features.
void AddTies(const Run& run, const std::filesystem::path& features, const ReconstructRunOptions& options,
             int ties_per_image, int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel,
             SurveyRun* survey);

}  // namespace trigpoint
