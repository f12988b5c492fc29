// The launcher: the one place where errors become a line on standard error and an exit code.
#include <glog/logging.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>

#include "app/cli/calibrate_command.h"
#include "app/cli/command.h"
#include "app/cli/excerpts.h"
#include "app/cli/field_commands.h"
#include "app/cli/interchange_commands.h"
#include "app/cli/stitch_command.h"
#include "datasets/io/readable.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/forked.h"

namespace trigpoint {
namespace {

CancelToken cancel_token;
std::vector<std::string> arguments;  // as they were given

// The first Ctrl-C asks the computation to stop, the second one ends the process.
void OnSignal(int signal) {
  cancel_token.Cancel();
  std::signal(signal, SIG_DFL);
}

int Fail(const Session& session, std::string message, int exit_code) {
  message = WithExcerpts(WithExcerpts(message), arguments);
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

// Names that were given as '': NearestName would find one for them.
std::string EmptyName(const CLI::App& app) {
  for (const CLI::App* command : app.get_subcommands()) {
    for (const char* name : {"--run", "--to"}) {
      const CLI::Option* option = command->get_option_no_throw(name);
      if (option == nullptr) continue;
      const std::vector<std::string>& given = option->results();
      if (std::find(given.begin(), given.end(), "") != given.end()) return name;
    }
    if (const std::string name = EmptyName(*command); !name.empty()) return name;
  }
  return "";
}

int Act(Session& session) {
  try {
    return CheckPrinted(session.action(session));
  } catch (const Error& e) {
    return Fail(session, e.what(), e.ExitCode());
  } catch (const std::filesystem::filesystem_error& e) {
    return Fail(session, IoErrorFor(e.path1(), "used", e.code().value()).what(), 1);
  } catch (const nlohmann::json::type_error& e) {
    const std::string said = e.what();  // "[json.exception.type_error.302] type must be number, but is string"
    return Fail(
        session,
        "a JSON file holds a value of another type than expected, most likely a manifest.json below results/ that "
        "was changed by hand: remove that result and run its stage again (" +
            said.substr(std::min(said.size(), said.find("] ") + 2)) + ")",
        1);
  } catch (const std::exception& e) {
    return Fail(session, OutOfMemory(e).value_or(std::string("unexpected error: ") + e.what()), 1);
  } catch (...) {
    return Fail(session, "unexpected error of unknown kind", 1);
  }
}

int Launch(int argc, char** argv) {
  FLAGS_minloglevel = google::GLOG_FATAL;  // Ceres logs steps that it takes back; what counts is in our own messages
  CLI::App app(
      "Trigpoint: from a folder of images to localized panoramas, and how good they are.\n"
      "`trigpoint <command> --help` describes a command and its options.",
      "trigpoint");
  app.set_version_flag("--version", TRIGPOINT_VERSION);
  app.require_subcommand(1);
  Session session;
  AddCommonOptions(app, session.options);
  session.cancel = &cancel_token;
  arguments.assign(argv + 1, argv + argc);
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
  if (const std::string name = EmptyName(app); !name.empty()) return Fail(session, name + " '': expected a name", 2);
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond its limit (ulimit -f) is then an error of the write
  return Act(session);
}

}  // namespace
}  // namespace trigpoint

int main(int argc, char** argv) { return trigpoint::Launch(argc, argv); }
