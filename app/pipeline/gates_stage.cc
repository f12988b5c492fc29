#include "app/pipeline/gates_stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "app/pipeline/stage_list.h"
#include "datasets/export/layer_text.h"
#include "datasets/io/photo_sets.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/gates/measures.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The stage whose results measure a gate: that of its section, but for consistency and other systems' trajectories.
std::string MeasuredBy(const std::string& section, const std::string& name) {
  if (section == "estimates" || name == "max_nees_per_dof") return "evaluate";
  return section == "calibration" ? "calibrate" : section;
}

// A name as it is written, in the form of the options: max-median -> max_median_m.
template <typename Known>
std::string FullName(std::string name, const Known& known) {
  std::replace(name.begin(), name.end(), '-', '_');
  for (const char* unit : {"", "_m", "_px", "_deg", "_percent"}) {
    if (known(name + unit)) return name + unit;
  }
  return name;
}

// {section: {name: limit}} of the block as it is written.
json Normalised(const json& gates, const std::string& where, std::vector<std::string>* problems) {
  std::set<std::string> sections, dotted;
  std::vector<std::string> names;
  for (const GateLimit& gate : AllGates()) {
    sections.insert(gate.section);
    dotted.insert(gate.Gate());
    names.push_back(gate.section == "evaluate" ? gate.name : gate.Gate());
  }
  json values = json::object();
  const auto add = [&](const std::string& section, const std::string& written, const json& limit) {
    const std::string name =
        FullName(written, [&](const std::string& n) { return dotted.count(section + "." + n) > 0; });
    if (dotted.count(section + "." + name) > 0) {
      if (!limit.is_null()) values[section][name] = limit;
      return;
    }
    // The same name in another section is nearer than another name.
    std::string nearest = NearestName(section == "evaluate" ? written : section + "." + written, names);
    for (const std::string& other : names) {
      if (other.substr(other.find('.') + 1) ==
          FullName(written, [&](const std::string& n) { return other.ends_with("." + n); })) {
        nearest = other;
      }
    }
    problems->push_back(fmt::format("{}: unknown gate '{}{}'{}", where, section == "evaluate" ? "" : section + ".",
                                    written, nearest.empty() ? "" : "; nearest known one: '" + nearest + "'"));
  };
  for (const auto& [key, value] : gates.items()) {
    if (key == "confidence") {
      values[key] = value;
    } else if (sections.count(key) > 0 && (value.is_object() || value.is_null())) {
      for (const auto& [name, limit] : value.items()) add(key, name, limit);
    } else if (sections.count(key) > 0) {
      problems->push_back(where + "." + key + ": expected a map of limits, found " + DumpJson(value));
    } else {
      add("evaluate", key, value);
    }
  }
  return values;
}

// A result that has limits, and where it lies.
struct JudgedResult {
  std::string stage, name;  // name: run@variant, photo set, ...
  std::string subject;
  fs::path dir;
  std::string problem;  // why it cannot be judged
};

// States as they are with the seed that the results were made with.
std::vector<JobState> StatesWithTheirSeed(const Project& project, const std::vector<Job>& jobs) {
  uint64_t seed = 1;
  for (const Job& job : jobs) {
    if (const auto manifest = ReadManifest(project, job.stage->name, ResultName(*job.stage, job.target))) {
      seed = manifest->value("seed", seed);
      break;
    }
  }
  return StatesOf(project, jobs, seed);
}

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
  for (const JobState& state : StatesWithTheirSeed(project, PlanJobs(project, query))) {
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
    std::error_code ignored;
    for (fs::directory_iterator it(project.results() / stage, ignored), end; it != end; it.increment(ignored)) {
      if (it->path().filename().string().front() != '.') names.insert(it->path().filename().string());
    }
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

json ReadJsonFile(const fs::path& file) {
  if (!fs::exists(file)) return {};
  json value = json::parse(ReadTextFile(file), nullptr, false);
  if (value.is_discarded()) throw InputError(file.string() + ": expected JSON, found something else");
  return value;
}

std::vector<GateMeasure> MeasuresOf(const JudgedResult& result, const std::string& variant, double confidence) {
  std::vector<GateMeasure> measures;
  const auto add = [&](const std::vector<GateMeasure>& more) {
    measures.insert(measures.end(), more.begin(), more.end());
  };
  if (result.stage == "survey") {
    add(SurveyMeasures(ReadJsonFile(result.dir / "summary.json"), ReadTagResults(result.dir / "tags.csv"), confidence));
  } else if (result.stage == "localize") {
    add(LocalizeMeasures(result.name, ReadLocalizeResult(result.dir).panoramas, confidence));
  } else if (result.stage == "evaluate") {
    add(EvaluationMeasures(ReadJsonFile(result.dir / "summary.json"), variant, confidence));
    add(EstimateMeasures(ReadJsonFile(result.dir / "estimates.json"), variant));
  } else {
    const json manifest = ReadJsonFile(result.dir / "manifest.json");
    const json metrics = manifest.is_object() ? manifest.value("metrics", json::object()) : json::object();
    add(result.stage == "stitch" ? StitchMeasures(result.name, metrics) : CalibrationMeasures(result.name, metrics));
  }
  return measures;
}

std::vector<GateResult> JudgeResults(const std::vector<GateLimit>& limits, const std::vector<JudgedResult>& results,
                                     const std::string& variant, double confidence) {
  std::vector<GateMeasure> measures;
  for (const JudgedResult& result : results) {
    std::string problem = result.problem;
    if (problem.empty()) {
      try {
        const std::vector<GateMeasure> its = MeasuresOf(result, variant, confidence);
        measures.insert(measures.end(), its.begin(), its.end());
        continue;
      } catch (const Error& e) {
        problem = e.what();
      }
    }
    for (const GateLimit& limit : limits) {
      if (MeasuredBy(limit.section, limit.name) != result.stage) continue;
      measures.push_back({.gate = limit.Gate(), .subject = result.subject, .reason = problem});
    }
  }
  return JudgeAll(limits, measures);
}

// A test case for each verdict; an undecided one is an error, so that no pipeline takes it for passed.
std::string JUnitXml(const std::string& project, const std::vector<GateResult>& results) {
  std::map<std::string, std::vector<const GateResult*>> suites;
  for (const GateResult& r : results) suites[r.limit.section].push_back(&r);
  const auto count = [](const std::vector<const GateResult*>& cases, Verdict verdict) {
    return std::count_if(cases.begin(), cases.end(), [&](const GateResult* r) { return r->verdict == verdict; });
  };
  std::string body;
  int64_t failed = 0, undecided = 0;
  for (const auto& [section, cases] : suites) {
    failed += count(cases, Verdict::kFailed), undecided += count(cases, Verdict::kUndecided);
    body += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"0\">\n", section,
                        cases.size(), count(cases, Verdict::kFailed), count(cases, Verdict::kUndecided));
    for (const GateResult* r : cases) {
      const std::string of = r->measure.subject.empty() ? "" : " (" + r->measure.subject + ")";
      body += fmt::format("    <testcase classname=\"trigpoint.{}\" name=\"{}\"", section, XmlText(r->limit.name + of));
      const std::string message = XmlText(r->message);
      if (r->verdict == Verdict::kPassed) {
        body += fmt::format(">\n      <system-out>{}</system-out>\n    </testcase>\n", message);
      } else {
        const bool is_failure = r->verdict == Verdict::kFailed;
        body += fmt::format(">\n      <{0} type=\"{1}\" message=\"{2}\"/>\n    </testcase>\n",
                            is_failure ? "failure" : "error", ToString(r->verdict), message);
      }
    }
    body += "  </testsuite>\n";
  }
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"{}\" tests=\"{}\" failures=\"{}\" "
      "errors=\"{}\">\n{}</testsuites>\n",
      XmlText(project), results.size(), failed, undecided, body);
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
  const std::string where = (project.dir() / "trigpoint.yaml").string() + ": gates";
  GateLimits limits;
  if (project.gates().is_object()) SetOptions(Normalised(project.gates(), where, problems), where, limits, *problems);
  GateLimits::Visit(limits, [&](const auto& section, const OptionInfo& info) {
    if constexpr (!std::is_arithmetic_v<std::decay_t<decltype(section)>>) {
      for (const std::string& p : CheckRanges(section)) problems->push_back(where + "." + info.name + ": " + p);
    }
  });
  if (!(limits.confidence >= 0.5 && limits.confidence <= 0.999)) {
    problems->push_back(fmt::format("{}: option confidence is {}, expected 0.5 to 0.999", where, limits.confidence));
  }
  for (const OptionLayer& layer : OptionLayers(project, "evaluate", target)) {
    EvaluateLimits::Visit(limits.evaluate, [&](double& limit, const OptionInfo& info) {
      const auto it = layer.values.find(info.name);
      if (it != layer.values.end() && it->is_number() && *it > 0) limit = *it;
    });
  }
  return limits;
}

json DefaultGates(const Project& project) {
  std::vector<std::string> ignored;
  if (!SetLimits(LimitsFor(project, {}, &ignored)).empty()) return {};
  const GateLimits limits = DefaultLimits();
  std::set<std::string> stages;
  for (const GateLimit& limit : SetLimits(limits)) stages.insert(MeasuredBy(limit.section, limit.name));
  std::vector<JudgedResult> results = ResultsFor(project, {}, stages);
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

std::vector<json> CountedGates(const json& metrics, const std::vector<std::string>& stages) {
  const auto made = [&](const std::string& stage) {
    return std::find(stages.begin(), stages.end(), stage) != stages.end();
  };
  std::vector<json> counted;
  const json gates = metrics.value("gates", json::array());
  for (const json& gate : gates) {
    if (made("gates") || made(MeasuredBy(gate.value("stage", ""), gate.value("name", "")))) counted.push_back(gate);
  }
  return counted;
}

bool GatesPassed(const json& metrics, const std::vector<std::string>& stages) {
  const std::vector<json> counted = CountedGates(metrics, stages);
  return std::all_of(counted.begin(), counted.end(),
                     [](const json& gate) { return gate.value("verdict", "") == "passed"; });
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
    std::set<std::string> stages;
    for (const GateLimit& limit : SetLimits(limits)) stages.insert(MeasuredBy(limit.section, limit.name));
    const std::vector<JudgedResult> results = ResultsFor(project, target, stages);
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
