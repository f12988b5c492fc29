// What all commands of `trigpoint` share.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/cli/ending.h"
#include "app/cli/terminal.h"
#include "app/pipeline/jobs.h"

namespace trigpoint {

// --quiet, --log-level, ... of the command that was given.
struct CommonOptions {
  bool quiet = false;
  bool verbose = false;
  bool json = false;
  std::string log_level = "warning";
  int threads = 0;
  uint64_t seed = 1;
  std::string units = "m";
};

// One invocation: the options, and where output goes. The ending and what was asked for go to standard output, the rest
// to standard error; with --json standard output holds one JSON document and nothing else.
struct Session {
  CommonOptions options;
  const CancelToken* cancel = nullptr;
  std::function<int(Session&)> action;  // set by the command that was given; returns the exit code
  std::shared_ptr<Messages> messages = std::make_shared<Messages>();
  std::chrono::steady_clock::time_point begun = std::chrono::steady_clock::now();

  Terminal MakeTerminal() const;
  // On a terminal the ending alone shows warnings, where people look; elsewhere they are also written as they arise.
  bool HoldsWarnings() const;
  void Print(const std::string& text) const;         // unless --quiet or --json
  void PrintDetails(const std::string& text) const;  // with --verbose: tables and what else is too long for an ending
  void PrintJson(nlohmann::json summary) const;      // if --json; adds the schema
  // The last thing a command does: its ending with the warnings and errors of this invocation.
  void End(Ending ending, size_t lines = kEndingLines) const;
  std::string Taken() const;  // "55 s", since the command began
};

// The exit code when everything was done but a quality gate is not passed.
constexpr int kGateExitCode = 3;

// --quiet, --json, ...; also those of the program itself, so that they may stand before the command.
void AddCommonOptions(CLI::App& app, CommonOptions& options);
// A command with the common options, and examples at the end of its help.
CLI::App& AddCommand(CLI::App& app, Session& session, const std::string& name, const std::string& help,
                     const std::string& footer);

// What became of jobs.
struct RunReport {
  std::vector<JobResult> results;
  std::vector<std::string> asked;     // stages of the jobs, without those that were added to them
  std::vector<std::string> problems;  // what was given and led to nothing
  nlohmann::json json;                // of --json
  int exit_code = 0;
};
// Runs jobs with progress, one line each on standard error; with --verbose their tables on standard output.
RunReport RunJobsShown(const Session& session, const std::string& command, const Project& project,
                       const std::vector<Job>& jobs);
// What is to be said at the end of it.
Ending EndingOf(const Session& session, const std::string& command, const Project& project, const RunReport& report);
// Both, with the JSON. Returns the exit code.
int RunAndReport(Session& session, const std::string& command, const Project& project, const std::vector<Job>& jobs);

// One stage by itself: progress under a title, and a line when it has ended.
StageOutcome RunStageShown(const Session& session, const Project& project, const StageRequest& request,
                           const std::string& title);

// A metric of a manifest as people read it; a name that ends in _m is a length. Empty if there is none.
std::string MetricText(const nlohmann::json& metrics, const std::string& name, const DisplayUnit& unit);

// Opens a project, checks its options, and shows its warnings.
Project OpenProject(const Session& session, const std::string& dir);
// The same for a command that computes: Project::OpenToCompute.
Project OpenProjectToCompute(const Session& session, const std::string& dir);

// Of the environment; empty where it is not set.
std::string EnvironmentText(const char* name);

// An input file that a command added lines to: these (the first few), and where the file as it was is kept.
void ShowChange(const std::filesystem::path& kept, const std::vector<std::string>& added, Ending* ending);

// "[stage.]option=value" of --set into {stage: {option: value}}; throws OptionError. Names without a stage of their own
// belong to `stage`; empty: they need one.
nlohmann::json ParseOverrides(const std::vector<std::string>& settings, const std::string& stage);

// --set of a command for one stage.
void AddSetOption(CLI::App& command, std::vector<std::string>* settings);

void AddInitCommand(CLI::App& app, Session& session);
void AddStatusCommand(CLI::App& app, Session& session);
void AddRunCommand(CLI::App& app, Session& session);
void AddStageCommand(CLI::App& app, Session& session, const StageInfo& stage);
void AddTrajectoryCommand(CLI::App& app, Session& session);
void AddPublishCommand(CLI::App& app, Session& session);
void AddVerifyCommand(CLI::App& app, Session& session);
void AddRerunCommand(CLI::App& app, Session& session);
void AddCompareCommand(CLI::App& app, Session& session);
void AddBatchCommand(CLI::App& app, Session& session);
void AddReviewCommand(CLI::App& app, Session& session);
void AddInspectCommand(CLI::App& app, Session& session);
void AddMarkCommand(CLI::App& app, Session& session);
void AddDemoCommand(CLI::App& app, Session& session);
void AddDoctorCommand(CLI::App& app, Session& session, const std::string& version);

}  // namespace trigpoint
