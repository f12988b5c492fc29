#include "app/cli/command.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "datasets/io/readable.h"
#include "datasets/project/files.h"
#include "datasets/project/yaml_json.h"

namespace trigpoint {

bool Session::HoldsWarnings() const {
  return !options.quiet && !options.json && !options.verbose && isatty(STDERR_FILENO) == 1;
}

Terminal Session::MakeTerminal() const {
  const LogLevel level = LogLevelNamed(options.log_level);
  return Terminal(options.verbose ? std::min(level, LogLevel::kInfo) : level, options.quiet, messages, HoldsWarnings());
}

void Session::Print(const std::string& text) const {
  if (!options.quiet && !options.json) std::fputs(text.c_str(), stdout);
}

void Session::PrintDetails(const std::string& text) const {
  if (options.verbose) Print(text);
}

void Session::End(Ending ending, size_t lines) const {
  for (const LogLevel level : {LogLevel::kError, LogLevel::kWarning}) {
    for (const auto& [its_level, text] : messages->said()) {
      if (its_level == level) ending.Problem(level == LogLevel::kError ? "Error" : "Warning", text);
    }
  }
  Print(ending.Text(options.verbose ? std::string::npos : lines));
}

std::string Session::Taken() const {
  return TakenText(std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
}

void Session::PrintJson(nlohmann::json summary) const {
  if (!options.json) return;
  summary["schema"] = 1;
  std::fputs((DumpJson(summary, 2) + "\n").c_str(), stdout);
}

void AddCommonOptions(CLI::App& app, CommonOptions& options) {
  const std::string group = "Common options";
  app.add_flag("--quiet", options.quiet, "print nothing but errors")->group(group);
  app.add_flag("--verbose", options.verbose, "also print tables and messages that are otherwise in files only")
      ->group(group);
  app.add_option("--log-level", options.log_level, "least level shown: debug, info, warning, error")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--threads", options.threads, "threads to compute on; 0: all cores")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str()
      ->group(group);
  app.add_option("--seed", options.seed, "seed of all random numbers; the same seed gives the same results")
      ->capture_default_str()
      ->group(group);
  app.add_option("--units", options.units, "unit of the lengths shown: m, ft, us-ft; files stay in metres")
      ->check(CLI::IsMember({"m", "ft", "us-ft"}))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--json", options.json, "print a machine-readable summary on standard output")->group(group);
}

CLI::App& AddCommand(CLI::App& app, Session& session, const std::string& name, const std::string& help,
                     const std::string& footer) {
  CLI::App& command = *app.add_subcommand(name, help);
  AddCommonOptions(command, session.options);
  command.footer(footer +
                 "\nExit codes: 0 done, 1 failed, 2 usage, 3 a quality gate failed or undecided, 130 "
                 "cancelled (Ctrl-C).");
  return command;
}

namespace {

Project Checked(const Session& session, Project project) {
  CheckProjectOptions(project);
  Terminal terminal = session.MakeTerminal();
  for (const std::string& warning : project.warnings()) terminal.Log(LogLevel::kWarning, warning);
  for (const Run& run : project.site().runs) {
    for (const std::string& warning : run.warnings) terminal.Log(LogLevel::kWarning, warning);
  }
  return project;
}

}  // namespace

Project OpenProject(const Session& session, const std::string& dir) { return Checked(session, Project::Open(dir)); }

Project OpenProjectToCompute(const Session& session, const std::string& dir) {
  return Checked(session, Project::OpenToCompute(dir));
}

std::string EnvironmentText(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

StageOutcome RunStageShown(const Session& session, const Project& project, const StageRequest& request,
                           const std::string& title) {
  Terminal terminal = session.MakeTerminal();
  terminal.SetTitle(title);
  StageOutcome outcome =
      RunStage(project, request, session.options.threads, session.options.seed, terminal, *session.cancel);
  terminal.ClearProgress();
  terminal.Say(title + ": " + (outcome.computed ? "computed" : "up to date"));
  return outcome;
}

void AddSetOption(CLI::App& command, std::vector<std::string>* settings) {
  command.add_option("--set", *settings, "option=value, over trigpoint.yaml (may be given several times)")
      ->allow_extra_args(false);
}

void ShowChange(const std::filesystem::path& kept, const std::vector<std::string>& added, Ending* ending) {
  constexpr size_t kShown = 3;
  for (size_t i = 0; i < std::min(added.size(), kShown); ++i) ending->Fact("Added", Excerpt(added[i]));
  if (added.size() > kShown) {
    ending->Fact("Added", Counted(added.size() - kShown, "more line"));
  }
  ending->Look("Old file", kept);
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

}  // namespace trigpoint
