// The stage that judges: limits of trigpoint.yaml's `gates:` against the results of the other stages.
#pragma once

#include <string>
#include <vector>

#include "app/pipeline/jobs.h"
#include "eval/gates/limits.h"

namespace trigpoint {

// The limits that hold for a target: the `gates:` block, under options of `evaluate` (--max-median). Names may lack
// their unit (`max_median: 0.2`), and the gates of `evaluate` may stand at the top. What is wrong is added to
// `problems`, one sentence each; an unknown name with the nearest known one.
GateLimits LimitsFor(const Project& project, const StageTarget& target, std::vector<std::string>* problems);

// As gates.json: the results that there are, judged by DefaultLimits(); nothing where the project sets limits of its
// own. For the report alone: no exit code depends on it.
nlohmann::json DefaultGates(const Project& project);

// The same jobs, with one of `gates` behind those whose results have limits (before the report).
std::vector<Job> WithGates(const Project& project, const std::vector<Job>& jobs);

}  // namespace trigpoint
