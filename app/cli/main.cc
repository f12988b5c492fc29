// The launcher: the one place where errors become a line on standard error and an exit code.
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <new>

#include "app/cli/calibrate_command.h"
#include "app/cli/command.h"
#include "app/cli/field_commands.h"
#include "app/cli/interchange_commands.h"
#include "app/cli/stitch_command.h"
#include "datasets/io/text.h"

namespace trigpoint {
namespace {

CancelToken cancel_token;

// The first Ctrl-C asks the computation to stop, the second one ends the process.
void OnSignal(int signal) {
  cancel_token.Cancel();
  std::signal(signal, SIG_DFL);
}

int Fail(const Session& session, std::string message, int exit_code) {
  for (char& c : message) c = c == '\n' ? ' ' : c;
  if (session.HoldsWarnings()) {  // there will be no ending to show them
    for (const auto& [level, text] : session.messages->said()) {
      if (level == LogLevel::kWarning) std::fputs(("warning: " + text + "\n").c_str(), stderr);
    }
  }
  std::fputs(("trigpoint: " + message + "\n").c_str(), stderr);
  session.PrintJson({{"ok", false}, {"error", message}, {"exit_code", exit_code}});
  return exit_code;
}

// What was printed must have arrived: a full disk behind a redirection is an error like any other.
int CheckPrinted(int exit_code) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return exit_code;
  const std::string why = errno != 0 ? std::strerror(errno) : "a write failed";
  std::fputs(("trigpoint: standard output cannot be written: " + why + "\n").c_str(), stderr);
  return exit_code == 0 ? 1 : exit_code;
}

int Launch(int argc, char** argv) {
  CLI::App app(
      "Trigpoint: from a folder of images to localized panoramas, and how good they are.\n"
      "`trigpoint <command> --help` describes a command and its options.",
      "trigpoint");
  app.set_version_flag("--version", TRIGPOINT_VERSION);
  app.require_subcommand(1);
  Session session;
  AddCommonOptions(app, session.options);
  session.cancel = &cancel_token;
  AddDemoCommand(app, session);
  AddInitCommand(app, session);
  AddStatusCommand(app, session);
  AddRunCommand(app, session);
  AddExportCommand(app, session);
  AddImportCommand(app, session);
  AddReviewCommand(app, session);
  AddInspectCommand(app, session);
  AddMarkCommand(app, session);
  AddCalibrateCommand(app, session);
  for (const StageInfo& stage : Stages()) AddStageCommand(app, session, stage);
  AddPublishCommand(app, session);
  AddVerifyCommand(app, session);
  AddRerunCommand(app, session);
  AddCompareCommand(app, session);
  AddManualCommand(app, session, TRIGPOINT_VERSION);
  AddStitchCommand(app, session);
  AddTrajectoryCommand(app, session);
  AddBatchCommand(app, session);
  AddDoctorCommand(app, session, TRIGPOINT_VERSION);
  AddCompletionCommand(app, session);
  AddPrintCommand(app, session);
  AddPlanCommand(app, session);
  AddCheckCommand(app, session);
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  if (argc == 1) {
    return Fail(session, "expected a command: `trigpoint demo` shows what it does, `trigpoint --help` lists all", 2);
  }
  if (argv[1][0] != '-' && std::find(names.begin(), names.end(), argv[1]) == names.end()) {
    return Fail(session,
                "unknown command '" + std::string(argv[1]) + "'; nearest: '" + NearestName(argv[1], names) +
                    "', see trigpoint --help",
                2);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {  // --help, --version
    const int code = app.exit(e);
    std::cout.flush();
    return std::cout.good() ? CheckPrinted(code) : CheckPrinted(1);
  } catch (const CLI::ParseError& e) {
    const std::vector<CLI::App*> parsed = app.get_subcommands();
    const std::string command = parsed.empty() ? "" : parsed.front()->get_name() + " ";
    return Fail(session, std::string(e.what()) + "; see trigpoint " + command + "--help", 2);
  }
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond its limit (ulimit -f) is then an error of the write
  try {
    return CheckPrinted(session.action(session));
  } catch (const Error& e) {
    return Fail(session, e.what(), e.ExitCode());
  } catch (const std::bad_alloc&) {
    return Fail(session, "not enough memory", 1);
  } catch (const std::exception& e) {
    return Fail(session, std::string("unexpected error: ") + e.what(), 1);
  } catch (...) {
    return Fail(session, "unexpected error of unknown kind", 1);
  }
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) { return trigpoint::Launch(argc, argv); }
