// batch: many projects as one graph of tasks, on this machine or on a cluster.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>
#include <thread>
#include <type_traits>

#include "app/cli/batch_list.h"
#include "app/cli/batch_plan.h"
#include "app/cli/command.h"
#include "app/pipeline/command_line.h"
#include "datasets/io/text.h"
#include "datasets/project/lock.h"
#include "datasets/project/task_lock.h"
#include "eval/report/overview.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct BatchArguments {
  std::vector<std::string> words;  // LIST, or an action and what it is for
  std::string out;
  BatchSettings settings;
  std::set<std::string> given;  // settings that the command line names
  bool wait = false;            // for Slurm
  bool retry = false;           // of a task
};

std::vector<TaskRecord> ReadRecords(const BatchPlan& plan, const fs::path& folder) {
  std::vector<TaskRecord> records;
  for (size_t i = 0; i < plan.tasks.size(); ++i) records.push_back(ReadTaskRecord(folder, i));
  return records;
}

// The state of every task, as far as it can be known on this machine.
std::vector<std::string> StatesOfTasks(const BatchPlan& plan, const std::vector<TaskRecord>& records) {
  if (plan.settings.engine == "slurm") return SlurmStates(plan, records);
  std::vector<std::string> states;
  for (size_t i = 0; i < records.size(); ++i) {
    std::string state = records[i].end;
    if (state == "running" && !TaskLock::IsHeld(plan.tasks[i].dir / "results", plan.tasks[i].title)) state = "lost";
    states.push_back(state.empty() ? "waiting" : state);
  }
  return states;
}

// index.html: a row for every line of the list, linked to the projects' own reports.
void WriteOverviewPage(const Session& session, const std::vector<BatchResult>& results, const fs::path& folder) {
  std::vector<OverviewProject> projects;
  for (const BatchResult& r : results) {
    OverviewProject project{r.entry.dir, r.status, r.error, r.entry.name, ""};
    const auto& words = r.entry.arguments;
    const auto variant = std::find(words.begin(), words.end(), "--variant");
    if (variant != words.end() && variant + 1 != words.end()) project.variant = variant[1];
    projects.push_back(std::move(project));
  }
  WriteOverview(projects, DisplayUnitNamed(session.options.units), folder / "index.html");
}

int ExitCodeOf(const std::vector<BatchResult>& results) {
  int code = 0;
  for (const BatchResult& r : results) {
    if (r.status == "failed") return 1;
    if (r.status == "gate") code = kGateExitCode;
  }
  return code;
}

std::vector<BatchResult> WriteSummary(const Session& session, const fs::path& folder, const BatchPlan& plan) {
  const std::vector<TaskRecord> records = ReadRecords(plan, folder);
  const std::vector<std::string> states = StatesOfTasks(plan, records);
  std::vector<BatchResult> results;
  for (size_t k = 0; k < plan.entries.size(); ++k) results.push_back(ResultOfEntry(plan, records, states, k));
  WriteBatchSummary(results, folder);
  WriteOverviewPage(session, results, folder);
  return results;
}

// Writes the summary and ends the command with it.
int Show(const Session& session, const fs::path& folder, const BatchPlan& plan, const std::string& headline,
         const std::string& next) {
  const std::vector<BatchResult> results = WriteSummary(session, folder, plan);
  const int exit_code = ExitCodeOf(results);
  const DisplayUnit unit = DisplayUnitNamed(session.options.units);
  session.PrintDetails(FormatBatch(results, unit) + "\n");
  Ending ending = BatchEnding(results, headline, unit);
  ending.Look("Summary", folder / "summary.md").Look("Reports", folder / "index.html");
  ending.RestIn(ShownPath(folder / "logs"));
  if (!next.empty()) ending.Next(next);
  session.End(ending);
  nlohmann::json summary = BatchJson(results);
  summary["command"] = "batch";
  summary["ok"] = exit_code == 0;
  summary["exit_code"] = exit_code;
  session.PrintJson(summary);
  return exit_code;
}

std::string Command(const char* action, const fs::path& folder) {
  return std::string("trigpoint batch ") + action + " " + ShellWord(ShownPath(folder));
}

void WaitForSlurm(const Session& session, const BatchPlan& plan) {
  constexpr int kPatience_s = 600;  // for a controller that does not answer
  for (int failed = 0;;) {
    session.cancel->ThrowIfCancelled();
    try {
      if (SlurmQueued(plan) == 0) return;
      failed = 0;
    } catch (const IoError&) {
      if (++failed > kPatience_s) throw;
    }
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
}

// Runs or submits the tasks of a plan that are not done. `lock`: of the folder, until they are.
int Execute(const Session& session, const fs::path& folder, const BatchPlan& plan, bool wait,
            std::unique_ptr<BatchLock> lock) {
  WriteSummary(session, folder, plan);  // first of all: by its summary.json a folder is known as a batch's
  WriteBatchPlan(plan, folder);
  if (plan.settings.engine == "slurm") {
    const size_t arrays = SubmitToSlurm(folder, plan);
    const BatchPlan submitted = ReadBatchPlan(folder);
    lock.reset();  // now the jobs in the queue keep others out, and `cancel` can have it
    if (wait) {
      WaitForSlurm(session, submitted);
      return Show(session, folder, submitted, "Batch done in " + session.Taken(), "");
    }
    return Show(session, folder, submitted, "Submitted " + Counted(arrays, "array job") + " to Slurm",
                Command("status", folder));
  }
  try {
    RunBatchLocally(session, folder, plan);
  } catch (const Cancelled&) {
    WriteSummary(session, folder, plan);
    throw;
  }
  return Show(session, folder, plan, "Batch done in " + session.Taken(), "");
}

fs::path DefaultFolder(const fs::path& list) {
  return fs::is_regular_file(list) ? list.parent_path() / (list.stem().string() + "-batch") : "trigpoint-batch";
}

// Tasks run in another folder than the command.
std::string ImageFrom(const std::string& container) {
  return container.empty() || container.find("://") != std::string::npos ? container : fs::absolute(container).string();
}

int Begin(const Session& session, const BatchArguments& arguments) {
  const std::string& list = arguments.words.front();
  const std::vector<BatchEntry> entries = ReadBatchList(list);
  const fs::path folder = fs::absolute(arguments.out.empty() ? DefaultFolder(list) : fs::path(arguments.out));
  BatchSettings settings = arguments.settings;
  settings.threads = session.options.threads;
  if (settings.engine == "slurm") settings.threads = std::max(1, settings.threads);
  if (!settings.memory.empty()) ParseMemory("--memory", settings.memory);
  ParseMemory("--task-memory", settings.task_memory);
  settings.container = ImageFrom(settings.container);
  RequireBatchFolder(folder);
  auto lock = std::make_unique<BatchLock>(folder);
  std::error_code ignored;
  if (fs::exists(folder / "batch.json", ignored)) RequireNothingQueued(ReadBatchPlan(folder), folder);
  const BatchPlan plan = MakeBatchPlan(session, entries, settings);
  fs::remove_all(folder / "tasks", ignored);  // of an earlier list
  return Execute(session, folder, plan, arguments.wait, std::move(lock));
}

int Resume(const Session& session, const BatchArguments& arguments, const fs::path& folder) {
  ReadBatchPlan(folder);  // throws where no batch is, before the lock makes a folder
  auto lock = std::make_unique<BatchLock>(folder);
  BatchPlan plan = ReadBatchPlan(folder);
  RequireNothingQueued(plan, folder);
  BatchSettings& then = plan.settings;
  BatchSettings::VisitMembers([&](const char* name, auto member, const char*) {
    if (arguments.given.count(name) > 0) then.*member = arguments.settings.*member;
  });
  then.container = ImageFrom(then.container);
  if (!then.memory.empty()) ParseMemory("--memory", then.memory);
  ParseMemory("--task-memory", then.task_memory);
  plan.submitted.clear();
  plan.summary_job.clear();
  if (session.options.threads > 0) then.threads = session.options.threads;
  if (then.engine == "slurm") then.threads = std::max(1, then.threads);
  return Execute(session, folder, plan, arguments.wait, std::move(lock));
}

// Asks the process that runs the batch, on this machine or another one, to stop, until it has.
void StopLocalRun(const Session& session, const fs::path& folder) {
  // 90 s: NFS may show the file to another machine a minute late (acdirmax), and tasks have 20 s before they are
  // killed.
  constexpr int kTries = 900, kPause_ms = 100;
  for (int i = 0; i < kTries && BatchLock::Holder(folder); ++i) {
    session.cancel->ThrowIfCancelled();
    WriteFileAtomically(folder / kCancelFile, "");  // each time: a run that begins takes away an older one
    std::this_thread::sleep_for(std::chrono::milliseconds(kPause_ms));
  }
}

int Cancel(const Session& session, const fs::path& folder) {
  if (ReadBatchPlan(folder).settings.engine != "slurm") StopLocalRun(session, folder);
  const BatchLock lock(folder);
  fs::remove(folder / kCancelFile);
  const BatchPlan plan = ReadBatchPlan(folder);  // as whoever had the lock left it
  if (plan.settings.engine == "slurm") {
    CancelInSlurm(plan);
    WaitForSlurm(session, plan);
  }
  std::vector<TaskRecord> records = ReadRecords(plan, folder);
  for (size_t i = 0; i < records.size(); ++i) {
    if (records[i].Ended()) continue;
    records[i].end = "cancelled";
    WriteTaskRecord(records[i], folder, i);
  }
  Show(session, folder, plan, "Batch cancelled", Command("resume", folder));
  return 0;
}

int RunBatch(const Session& session, const BatchArguments& arguments) {
  const std::string& action = arguments.words.front();
  const bool is_action = action == "status" || action == "resume" || action == "cancel" || action == "task";
  const size_t expected = action == "task" ? 3 : is_action ? 2 : 1;
  if (arguments.words.size() != expected) {
    throw OptionError("batch: expected LIST, or status, resume or cancel and a LIST or the folder of a batch, found " +
                      std::to_string(arguments.words.size()) + " words");
  }
  if (!is_action) return Begin(session, arguments);
  const fs::path given = arguments.words[1];
  fs::path folder = given;
  if (!fs::is_directory(given)) folder = arguments.out.empty() ? DefaultFolder(given) : fs::path(arguments.out);
  folder = fs::absolute(folder).lexically_normal();
  if (action == "task") {
    const auto number = ParseInt(arguments.words[2]);
    if (!number || *number < 0) throw OptionError("batch task: expected a number, found " + arguments.words[2]);
    return RunBatchTask(session, folder, static_cast<size_t>(*number), arguments.retry);
  }
  if (action == "resume") return Resume(session, arguments, folder);
  if (action == "cancel") return Cancel(session, folder);
  Show(session, folder, ReadBatchPlan(folder), "Batch", "");
  return 0;
}

// task_memory -> --task-memory
std::string OptionOf(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return "--" + name;
}

void AddOptions(CLI::App& command, BatchArguments* a) {
  command
      .add_option(
          "LIST", a->words,
          "a list file, or a pattern of folders in quotes; or status, resume, cancel and the same, or the batch's "
          "folder")
      ->required()
      ->expected(1, 3);
  command.add_option("--out", a->out, "where the summary goes; default: beside the list, <list>-batch");
  BatchSettings::VisitMembers([&](const std::string& name, auto member, const std::string& help) {
    if (help.empty()) return;
    auto& value = a->settings.*member;
    CLI::Option* option = command.add_option(OptionOf(name), value, help);
    option->each([a, name](const std::string&) { a->given.insert(name); });
    if constexpr (std::is_same_v<decltype(value), std::vector<std::string>&>) {
      option->allow_extra_args(false);
    } else {
      option->capture_default_str();
    }
  });
  command.get_option("--engine")->check(CLI::IsMember({"local", "slurm"}));
  command.get_option("--jobs")->check(CLI::Range(0, 1024));
  command.get_option("--task-minutes")->check(CLI::NonNegativeNumber);
  command.add_flag("--wait", a->wait, "slurm: end when all tasks have ended");
  command.add_flag("--retry", a->retry)->group("");
}

}  // namespace

void AddBatchCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "batch", "run many projects, runs and variants unattended, on this machine or on a cluster",
      "LIST is a file with one project a line (options of `trigpoint run` behind it), or a pattern of folders in\n"
      "quotes. Every stage of every run is a task, which starts when those it needs have ended. A task that\n"
      "fails does not stop the others. A task that is killed or runs out of memory is started once more: on this\n"
      "machine with no other task beside it, on a cluster with twice the memory. --out receives summary.json, .csv\n"
      "and .md, and index.html with links to all reports.\n\n"
      "  batch status LIST   show which tasks are done, running or failed, and their cost; write the summary\n"
      "  batch resume LIST   run the tasks that are not done, also after a kill or a full disk\n"
      "  batch cancel LIST   stop the tasks; results of finished tasks are kept\n\n"
      "The exit code is 1 if a task failed, else 3 if a quality gate did not pass.\n\n"
      "Examples:\n"
      "  trigpoint batch sites.txt --jobs 2 --memory 6G\n"
      "  trigpoint batch \"/data/sites/*\"\n"
      "  trigpoint batch sites.txt --engine slurm --partition main --threads 8\n"
      "A line of sites.txt:\n"
      "  street_a --run monday --variant trial --set localize.registration.max_distance_m=20");
  const auto a = std::make_shared<BatchArguments>();
  AddOptions(command, a.get());
  command.callback([&session, a] { session.action = [a](Session& s) { return RunBatch(s, *a); }; });
}

}  // namespace trigpoint
