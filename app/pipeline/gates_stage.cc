#include "app/pipeline/gates_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "app/pipeline/stage_list.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/gates/judge_results.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The results of stages of the plan that have limits, with their states.
std::vector<JudgedResult> PlannedResults(const Project& project, const StageTarget& target,
                                         const std::set<std::string>& stages) {
  std::vector<JudgedResult> results;
  JobQuery query;
  query.variants = {target.variant};
  query.overrides = target.overrides;
  for (const char* stage : {"localize", "survey", "evaluate"}) {
    if (stages.count(stage) > 0) query.stages.push_back(stage);
  }
  if (query.stages.empty()) return results;
  const std::vector<Job> jobs = PlanJobs(project, query);
  for (const JobState& state : StatesOf(project, jobs, SeedOf(project, jobs))) {
    const std::string& stage = state.job.stage->name;
    if (std::find(query.stages.begin(), query.stages.end(), stage) == query.stages.end()) continue;
    const std::string name = ResultName(*state.job.stage, state.job.target);
    JudgedResult result{stage, name, state.job.target.run, project.ResultDir(stage, name), ""};
    const std::string reason = state.reason.empty() ? "" : ": " + state.reason;
    if (state.manifest.is_null()) {
      result.problem = !state.needed ? stage + " was not run" + reason : stage + " was not run";
    } else if (state.needed && state.state == StageState::kFailed) {
      result.problem = "the newest " + stage + " failed" + reason;
    } else if (state.needed && state.state == StageState::kOutOfDate) {
      result.problem = "the result of " + stage + " is out of date" + reason;
    }
    results.push_back(std::move(result));
  }
  return results;
}

// All results that have limits.
std::vector<JudgedResult> ResultsFor(const Project& project, const StageTarget& target,
                                     const std::set<std::string>& stages) {
  std::vector<JudgedResult> results = PlannedResults(project, target, stages);
  const auto named = [&](const std::string& stage, std::set<std::string> names) {
    if (stages.count(stage) == 0) return;
    names.merge(ResultsIn(project.results() / stage));
    for (const std::string& name : names) {
      JudgedResult result{stage, name, name, project.ResultDir(stage, name), ""};
      if (!fs::exists(result.dir / "manifest.json")) {
        result.problem = stage + " was not run";
      } else if (const auto failure = ReadFailure(project, stage, name)) {
        result.problem = "the newest " + stage + " failed: " + failure->value("error", "");
      }
      results.push_back(std::move(result));
    }
  };
  std::set<std::string> sets;
  for (const fs::path& dir : PhotoSetFolders(project.dir())) sets.insert(dir.filename().string());
  named("stitch", sets);
  named("calibrate", {});
  return results;
}

struct GateStageOptions {
  template <typename Self, typename Visitor>
  static void Visit(Self&, Visitor&&) {}
  std::vector<std::string> Check() const { return {}; }
};

void JudgeProject(const GateLimits& limits, const std::vector<JudgedResult>& results, const std::string& variant,
                  StageContext& context) {
  const std::vector<GateResult> verdicts = JudgeResults(SetLimits(limits), results, variant, limits.confidence);
  const json table = GatesJson(verdicts);
  WriteFileAtomically(context.out / "gates.json", DumpJson(table, 2) + "\n");
  WriteFileAtomically(context.out / "gates.xml", JUnitXml(context.project.name(), verdicts));
  for (const char* unit : {"m", "ft", "us-ft"}) {
    const DisplayUnit shown = DisplayUnitNamed(unit);
    WriteFileAtomically(context.out / fmt::format("gates_{}.md", unit),
                        FormatGates(verdicts, shown.name, shown.metres));
  }
  context.metrics["verdict"] = ToString(OverallVerdict(verdicts));
  context.metrics["gates"] = table["gates"];
}

}  // namespace

GateLimits LimitsFor(const Project& project, const StageTarget& target, std::vector<std::string>* problems) {
  GateLimits limits = ReadLimits(project.gates(), (project.dir() / "trigpoint.yaml").string() + ": gates", problems);
  for (const OptionLayer& layer : OptionLayers(project, "evaluate", target)) LayOver(layer.values, &limits.evaluate);
  return limits;
}

json DefaultGates(const Project& project) {
  std::vector<std::string> ignored;
  if (!SetLimits(LimitsFor(project, {}, &ignored)).empty()) return {};
  const GateLimits limits = DefaultLimits();
  std::vector<JudgedResult> results = ResultsFor(project, {}, JudgedStages(limits));
  std::erase_if(results, [](const JudgedResult& result) { return !result.problem.empty(); });
  std::vector<GateResult> verdicts = JudgeResults(SetLimits(limits), results, "", limits.confidence);
  // Parts that a project need not have (a survey, photo sets, a calibration; of photos alone: runs) are no finding.
  // Where runs are, accuracy that nothing measures is one: undecided.
  const bool has_runs = !project.site().runs.empty();
  std::erase_if(verdicts, [&](const GateResult& verdict) {
    const std::string& part = verdict.limit.section;
    return !verdict.measure.value && !(has_runs && (part == "localize" || part == "evaluate"));
  });
  return verdicts.empty() ? json() : GatesJson(verdicts);
}

std::vector<Job> WithGates(const Project& project, const std::vector<Job>& jobs) {
  if (std::any_of(jobs.begin(), jobs.end(), [](const Job& job) { return job.stage->name == "gates"; })) return jobs;
  std::vector<Job> gates;
  std::set<std::string> variants;
  for (const Job& job : jobs) {
    std::vector<std::string> ignored;
    const std::vector<GateLimit> limits = SetLimits(LimitsFor(project, job.target, &ignored));
    const bool judged = std::any_of(limits.begin(), limits.end(), [&](const GateLimit& limit) {
      return MeasuredBy(limit.section, limit.name) == job.stage->name;
    });
    if (!judged || !variants.insert(job.target.variant).second) continue;
    gates.push_back({&StageNamed("gates"), {"", job.target.variant, job.target.overrides}});
  }
  std::vector<Job> all = jobs;
  const auto report = std::find_if(all.begin(), all.end(), [](const Job& job) { return job.stage->name == "report"; });
  all.insert(report, gates.begin(), gates.end());
  return all;
}

StageInfo GatesStage() {
  StageInfo info;
  info.name = "gates";
  info.help = "judge the results by the limits of trigpoint.yaml's gates: passed, failed or undecided";
  info.per_run = false;
  info.variants = true;
  info.metric = "verdict";
  UseOptions<GateStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    std::vector<std::string> problems;
    const GateLimits limits = LimitsFor(project, target, &problems);
    ThrowIfAny(problems);
    const std::vector<JudgedResult> results = ResultsFor(project, target, JudgedStages(limits));
    StageRequest request;
    request.version = 3;
    request.values["limits"] = JsonFromOptions(limits);
    request.values["variant"] = target.variant;
    for (const JudgedResult& result : results) {
      request.inputs.push_back(result.dir / "manifest.json");
      request.values["results"].push_back({result.stage, result.name, result.problem});
    }
    request.body = [limits, results, variant = target.variant](StageContext& context) {
      JudgeProject(limits, results, variant, context);
    };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget& target) -> std::string {
    std::vector<std::string> problems;
    return SetLimits(LimitsFor(project, target, &problems)).empty() ? "no gate is set" : "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return ReadTextFile(outcome.dir / ("gates_" + unit.name + ".md")) +
           "Verdicts: " + (outcome.dir / "gates.json").string() + ", gates.xml\n";
  };
  return info;
}

}  // namespace trigpoint
