#include "app/pipeline/command_line.h"

#include "app/pipeline/stitch_stage.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

void AddSettings(const nlohmann::json& values, const std::string& prefix, std::string& line) {
  for (const auto& [name, value] : values.items()) {
    if (value.is_object()) {
      AddSettings(value, prefix + name + ".", line);
    } else {
      line += " --set " + ShellWord(prefix + name + "=" + DumpJson(value));
    }
  }
}

// How the command names what its results are named after.
const char* NameFlag(const std::string& stage) {
  if (stage == "stitch") return " --set ";
  return stage == "calibrate" ? " --name " : " --run ";
}

}  // namespace

std::vector<const StageInfo*> AllStages() {
  std::vector<const StageInfo*> all;
  for (const StageInfo& stage : Stages()) all.push_back(&stage);
  for (const char* other : {"stitch", "calibrate", "plan"}) all.push_back(&StageNamed(other));
  return all;
}

std::vector<Job> AskedJobs(const Project& project, const JobQuery& query) {
  const std::string stage = query.stages.size() == 1 ? query.stages.front() : "";
  if (stage == "plan") return {{&StageNamed(stage), {"", "", query.overrides}}};
  if (stage == "stitch") return StitchJobs(project, query.runs, query.overrides);
  std::vector<Job> jobs;
  if (query.stages.empty()) jobs = StitchJobs(project, {}, query.overrides);  // as `trigpoint run`
  if (stage != "calibrate") {
    for (Job& job : PlanJobs(project, query)) jobs.push_back(std::move(job));
    return jobs;
  }
  for (const std::string& name : query.runs) {
    CheckVariantName(name);
    jobs.push_back({&StageNamed(stage), {name, "", query.overrides}});
  }
  return jobs;
}

std::string CommandLine(const std::string& dir, const JobQuery& query, int threads, uint64_t seed) {
  const bool single = query.stages.size() == 1;
  const StageInfo* stage = single ? &StageNamed(query.stages.front()) : nullptr;
  std::string line = "trigpoint " + (single ? CommandOf(*stage) : "run") + " " + ShellWord(dir);
  const char* flag = NameFlag(single ? query.stages.front() : "");
  for (const std::string& run : query.runs) line += flag + ShellWord(run);
  // The first set of results and others: what `run` makes where no variant is named.
  const bool all = !single && query.variants.size() > 1 && query.variants.front().empty();
  if ((!single || stage->variants) && !all) {
    for (const std::string& variant : query.variants) {
      if (!variant.empty()) line += " --variant " + ShellWord(variant);
    }
  }
  for (const auto& [name, values] : query.overrides.items()) {
    AddSettings(values, single && name == query.stages.front() ? "" : name + ".", line);
  }
  if (threads != 0) line += " --threads " + std::to_string(threads);
  if (seed != 1) line += " --seed " + std::to_string(seed);
  return line;
}

}  // namespace trigpoint
