// estimates/<system>/<run>.tum against results/reference/<run>.
#pragma once

#include <filesystem>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "eval/estimates.h"

namespace trigpoint {

// Every file that ScoreEstimates reads.
std::vector<std::filesystem::path> EstimateInputs(const Project& project);

// One report for every system and run that has a trajectory and reference poses. One that cannot be scored is named in
// a warning, and the others go on.
std::vector<EstimateReport> ScoreEstimates(const Project& project, const EstimateScoreOptions& options,
                                           ProgressSink& progress);

}  // namespace trigpoint
