// The command that does what a window is about to do.
#pragma once

#include <string>
#include <vector>

#include "app/pipeline/jobs.h"
#include "datasets/io/text.h"  // ShellWord

namespace trigpoint {

// What can be asked for: the stages of a run, then stitch and calibrate, whose results have names of their own (photo
// sets, calibrations) that stand in place of the runs in a query, and plan.
std::vector<const StageInfo*> AllStages();
// The jobs of a query for any of these. Throws InputError for a run or a photo set that isn't there.
std::vector<Job> AskedJobs(const Project& project, const JobQuery& query);

// What a person would type: `trigpoint <stage> DIR ...` for one stage, `trigpoint run DIR ...` for all.
std::string CommandLine(const std::string& dir, const JobQuery& query, int threads, uint64_t seed);

}  // namespace trigpoint
