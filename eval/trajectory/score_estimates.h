// Our own cameras, and estimates/<system>/<run>.tum, against results/reference/<run>.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "eval/errors/evaluate.h"
#include "eval/trajectory/estimates.h"

namespace trigpoint {

// Our own cameras as a system: "trigpoint", of a variant "trigpoint@V".
std::string OwnSystem(const std::string& variant);
// Of any variant: nobody else's system may be called so.
bool IsOwnSystem(const std::string& system);

// Every file that ScoreEstimates reads, beside results of localize: trajectories, and the reference poses there are.
std::vector<std::filesystem::path> EstimateInputs(const Project& project);

// One report for every system and run that has a trajectory and reference poses; first of our own cameras. A run that
// has no place in the site's frame is fitted to the reference first. One that cannot be scored is named in a warning,
// and the others go on.
std::vector<EstimateReport> ScoreEstimates(const Project& project, const EstimateScoreOptions& options,
                                           const std::vector<EvaluatedRun>& runs, ProgressSink& progress);

}  // namespace trigpoint
