// What all commands of `trigpoint` share.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/cli/terminal.h"
#include "app/pipeline/jobs.h"

namespace trigpoint {

// --quiet, --log-level, ... of the command that was given.
struct CommonOptions {
  bool quiet = false;
  bool json = false;
  std::string log_level = "warning";
  int threads = 0;
  uint64_t seed = 1;
  std::string units = "m";
};

// One invocation: the options, and where output goes. Tables go to standard output, the rest to standard error; with
// --json standard output holds one JSON document and nothing else.
struct Session {
  CommonOptions options;
  const CancelToken* cancel = nullptr;
  std::function<int(Session&)> action;  // set by the command that was given; returns the exit code

  Terminal MakeTerminal() const { return Terminal(LogLevelNamed(options.log_level), options.quiet); }
  void Print(const std::string& text) const;     // unless --quiet or --json
  void PrintJson(nlohmann::json summary) const;  // if --json; adds the schema
};

// The exit code when everything was done but a quality gate is not passed.
constexpr int kGateExitCode = 3;

// A command with the common options, and examples at the end of its help.
CLI::App& AddCommand(CLI::App& app, Session& session, const std::string& name, const std::string& help,
                     const std::string& footer);

// Runs jobs with progress, one line each on standard error, and their tables. Returns the exit code.
int RunAndReport(Session& session, const std::string& command, const Project& project, const std::vector<Job>& jobs);

// Opens a project, checks its options, and shows its warnings.
Project OpenProject(const Session& session, const std::string& dir);

// "[stage.]option=value" of --set into {stage: {option: value}}; throws OptionError. Names without a stage of their own
// belong to `stage`; empty: they need one.
nlohmann::json ParseOverrides(const std::vector<std::string>& settings, const std::string& stage);

void AddInitCommand(CLI::App& app, Session& session);
void AddStatusCommand(CLI::App& app, Session& session);
void AddRunCommand(CLI::App& app, Session& session);
void AddStageCommand(CLI::App& app, Session& session, const StageInfo& stage);
void AddTrajectoryCommand(CLI::App& app, Session& session);
void AddPublishCommand(CLI::App& app, Session& session);
void AddVerifyCommand(CLI::App& app, Session& session);
void AddCompareCommand(CLI::App& app, Session& session);
void AddBatchCommand(CLI::App& app, Session& session);
void AddReviewCommand(CLI::App& app, Session& session);
void AddInspectCommand(CLI::App& app, Session& session);
void AddMarkCommand(CLI::App& app, Session& session);
void AddDemoCommand(CLI::App& app, Session& session);

}  // namespace trigpoint
