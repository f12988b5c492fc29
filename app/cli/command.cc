#include "app/cli/command.h"

#include <fmt/format.h>

#include <cstdio>

#include "datasets/io/site_inputs.h"
#include "datasets/project/files.h"
#include "datasets/project/yaml_json.h"

namespace trigpoint {

void Session::Print(const std::string& text) const {
  if (!options.quiet && !options.json) std::fputs(text.c_str(), stdout);
}

void Session::PrintJson(nlohmann::json summary) const {
  if (!options.json) return;
  summary["schema"] = 1;
  std::fputs((DumpJson(summary, 2) + "\n").c_str(), stdout);
}

CLI::App& AddCommand(CLI::App& app, Session& session, const std::string& name, const std::string& help,
                     const std::string& footer) {
  CLI::App& command = *app.add_subcommand(name, help);
  CommonOptions& options = session.options;
  const std::string group = "Common options";
  command.add_flag("--quiet", options.quiet, "say nothing but errors")->group(group);
  command.add_option("--log-level", options.log_level, "least level shown: debug, info, warning, error")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str()
      ->group(group);
  command.add_option("--threads", options.threads, "threads to compute on; 0: all cores")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str()
      ->group(group);
  command.add_option("--seed", options.seed, "seed of all random numbers; the same seed gives the same results")
      ->capture_default_str()
      ->group(group);
  command.add_option("--units", options.units, "unit of the lengths shown: m, ft, us-ft; files stay in metres")
      ->check(CLI::IsMember({"m", "ft", "us-ft"}))
      ->capture_default_str()
      ->group(group);
  command.add_flag("--json", options.json, "print a machine-readable summary on standard output")->group(group);
  command.footer(footer +
                 "\nExit codes: 0 done, 1 failed, 2 usage, 3 a quality gate failed or undecided, 130 "
                 "cancelled (Ctrl-C).");
  return command;
}

Project OpenProject(const Session& session, const std::string& dir) {
  Project project = Project::Open(dir);
  CheckProjectOptions(project);
  Terminal terminal = session.MakeTerminal();
  for (const std::string& warning : project.warnings()) terminal.Log(LogLevel::kWarning, warning);
  for (const Run& run : project.site().runs) {
    for (const std::string& warning : run.warnings) terminal.Log(LogLevel::kWarning, warning);
  }
  return project;
}

nlohmann::json ParseOverrides(const std::vector<std::string>& settings, const std::string& default_stage) {
  nlohmann::json overrides = nlohmann::json::object();
  for (const std::string& setting : settings) {
    const size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw OptionError("--set " + setting + ": expected [stage.]option=value");
    }
    std::string name = setting.substr(0, equals);
    std::string stage = default_stage;
    const std::string first = name.substr(0, name.find('.'));
    for (const StageInfo& info : Stages()) {
      if (info.name != first || first.size() == name.size()) continue;
      stage = first;
      name = name.substr(first.size() + 1);
    }
    if (stage.empty()) throw OptionError("--set " + setting + ": expected stage.option=value");
    nlohmann::json* at = &overrides[stage];
    for (size_t begin = 0; begin <= name.size();) {
      const size_t dot = std::min(name.find('.', begin), name.size());
      if (!at->is_null() && !at->is_object()) throw OptionError("--set " + setting + ": it is set twice");
      at = &(*at)[name.substr(begin, dot - begin)];
      begin = dot + 1;
    }
    *at = JsonFromYamlText(setting.substr(equals + 1));
  }
  overrides = MovedOptions(std::move(overrides));
  std::vector<std::string> problems;
  for (const auto& [stage, values] : overrides.items()) StageNamed(stage).check(values, "command line", problems);
  ThrowIfAny(problems);
  return overrides;
}

namespace {

// What was given and led to nothing: tables without a usable row, references of which none is localized.
std::vector<std::string> GivenForNothing(const Project& project, const std::vector<JobResult>& results) {
  std::vector<std::string> problems;
  int64_t references = 0, localized = 0;
  bool reads_tables = false;
  for (const JobResult& result : results) {
    const std::string& stage = result.job.stage->name;
    reads_tables = reads_tables || (stage != "features" && stage != "reconstruct" && stage != "detect" &&
                                    stage != "calibrate" && stage != "stitch");
    const bool there = result.end == JobEnd::kComputed || result.end == JobEnd::kUpToDate;
    if (stage != "localize" || !there) continue;
    references += result.outcome.manifest["metrics"].value("references", int64_t{0});
    localized += result.outcome.manifest["metrics"].value("localized", int64_t{0});
  }
  if (reads_tables) {
    for (const std::string& why : UnusedTables(project.dir()))
      problems.push_back(why + "; nothing of this file is used");
  }
  if (references > 0 && localized == 0) {
    problems.push_back(fmt::format(
        "localize: none of {} references is localized; column reason of results/localize/*/panoramas.csv has the cause",
        references));
  }
  return problems;
}

}  // namespace

int RunAndReport(Session& session, const std::string& command, const Project& project, const std::vector<Job>& jobs) {
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  Terminal terminal = session.MakeTerminal();
  JobCallbacks callbacks;
  callbacks.begun = [&](const Job& job) { terminal.SetTitle(job.Title()); };
  callbacks.ended = [&](const JobResult& result) {
    terminal.SetTitle("");
    std::string line = result.job.Title() + ": " + std::string(JobEndName(result.end));
    if (result.end == JobEnd::kComputed) {
      line += fmt::format(" in {:.1f} s", result.outcome.manifest.value("wall_seconds", 0.0));
    }
    if (!result.reason.empty()) line += ": " + result.reason;
    if (result.end == JobEnd::kFailed) {
      terminal.Log(LogLevel::kError, line);
    } else {
      terminal.Say(line);
    }
  };
  const std::vector<JobResult> results =
      RunJobs(project, jobs, session.options.threads, session.options.seed, terminal, *session.cancel, callbacks);
  terminal.ClearProgress();

  int exit_code = 0;
  bool gates_passed = true;
  nlohmann::json stages = nlohmann::json::array();
  for (const JobResult& result : results) {
    const bool there = result.end == JobEnd::kComputed || result.end == JobEnd::kUpToDate;
    stages.push_back({{"stage", result.job.stage->name},
                      {"name", ResultName(*result.job.stage, result.job.target)},
                      {"status", JobEndName(result.end)},
                      {"reason", result.reason},
                      {"dir", there ? result.outcome.dir.string() : ""},
                      {"metrics", there ? result.outcome.manifest["metrics"] : nlohmann::json::object()},
                      {"warnings", there ? result.outcome.manifest["warnings"] : nlohmann::json::array()}});
    if (result.end == JobEnd::kFailed)
      exit_code = exit_code == 0 || exit_code == result.exit_code ? result.exit_code : 1;
    if (there && result.outcome.manifest["metrics"].value("verdict", "PASS") != "PASS") gates_passed = false;
    if (there && result.job.stage->summary) session.Print(result.job.stage->summary(result.outcome, unit));
  }
  const std::vector<std::string> problems = GivenForNothing(project, results);
  for (const std::string& problem : problems) terminal.Log(LogLevel::kError, problem);
  if (exit_code == 0 && !problems.empty()) exit_code = 1;
  if (exit_code == 0 && !gates_passed) exit_code = kGateExitCode;
  session.PrintJson({{"command", command},
                     {"project", project.dir().string()},
                     {"ok", exit_code == 0},
                     {"exit_code", exit_code},
                     {"problems", problems},
                     {"stages", stages}});
  return exit_code;
}

}  // namespace trigpoint
