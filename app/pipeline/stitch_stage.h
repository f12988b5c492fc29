// Stitching: a stage with one result per photo set, results/stitch/<set>, in place of one per run.
#pragma once

#include "app/pipeline/jobs.h"
#include "app/pipeline/stages.h"

namespace trigpoint {

// Not among Stages(): its names are those of photo sets, which stand in StageTarget::run. StageNamed knows it.
StageInfo StitchStage();

// One job per photo set of the project, or of a plain folder of photos; `sets` empty: all. Throws InputError for one
// that is not there, naming the nearest.
std::vector<Job> StitchJobs(const Project& project, std::vector<std::string> sets, const nlohmann::json& overrides);

}  // namespace trigpoint
