// What `run` shares with commands that run its jobs in their own way.
#pragma once

#include <string>
#include <vector>

#include "app/cli/command.h"

namespace trigpoint {

// What `run` is asked for, also on a line of a batch's list.
struct RunArguments {
  std::vector<std::string> runs, variants, settings;
};
void AddRunOptions(CLI::App& app, RunArguments* arguments);
// Every job of `run`, photo sets first: localize reads their rigs. Throws InputError, OptionError.
std::vector<Job> JobsOf(const Project& project, const RunArguments& arguments);

// The report of jobs that have ended; `jobs`: those that were asked for.
RunReport ReportOf(const std::string& command, const Project& project, const std::vector<Job>& jobs,
                   std::vector<JobResult> results);

}  // namespace trigpoint
