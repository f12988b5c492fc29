// The graph of a batch: a task for every run and stage of every project of its list, and what became of each. It is
// kept in the batch's folder, which every machine that works on it shares:
//
//   batch.json         the plan: entries, tasks, what they wait for, what they are given
//   tasks/<n>.json     what became of task n, written by whoever runs it
//   logs/              what they wrote on standard error
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/batch_list.h"
#include "app/cli/run_command.h"
#include "app/pipeline/single_job.h"

namespace trigpoint {

struct BatchTask {
  std::filesystem::path dir;  // the project
  std::string stage, title;   // "localize", "localize/run1"
  StageTarget target;
  uint64_t seed = 1;
  std::vector<size_t> needs, after;  // tasks, as JobNeeds
  int64_t memory_bytes = 0;          // to be asked for, from what was measured before; 0: nothing was
  double seconds = 0;                // wall time, the same
};

struct PlannedEntry {
  BatchEntry entry;
  std::string error;  // why it cannot be planned
  int exit_code = 0;  // with it
  std::vector<size_t> tasks;
};

// How the tasks are run.
struct BatchSettings {
  std::string engine = "local";
  int threads = 0;                 // of a task; 0: the engine's choice
  std::string memory;              // local: of all tasks together
  int jobs = 0;                    // local: tasks at a time
  std::string task_memory = "4G";  // slurm: of a task that was not measured
  double task_minutes = 0;         // slurm: the same, 0: the partition's own limit
  std::string partition, account, container;
  std::vector<std::string> sbatch;  // further options of sbatch

  // Each as visit(name, member, help). The name is the key in batch.json and, with '-' for '_', the option of the
  // command; `threads`, without help, is one of the common options.
  template <typename Visitor>
  static void VisitMembers(Visitor&& visit) {
    visit("engine", &BatchSettings::engine, "local: this machine; slurm: a cluster, through sbatch");
    visit("threads", &BatchSettings::threads, "");
    visit("jobs", &BatchSettings::jobs, "local: number of tasks that run at the same time; 0: one per core");
    visit("memory", &BatchSettings::memory,
          "local: memory limit of all running tasks together, as 4G or 800M; default: 80 % of the free memory");
    visit("task_memory", &BatchSettings::task_memory,
          "slurm: memory to request for a task that no earlier result was measured for");
    visit("task_minutes", &BatchSettings::task_minutes,
          "slurm: minutes to request for such a task; 0: the partition's own limit");
    visit("partition", &BatchSettings::partition, "slurm: partition that the tasks run in");
    visit("account", &BatchSettings::account, "slurm: account that is charged");
    visit("container", &BatchSettings::container,
          "slurm: image that Apptainer runs the tasks in (docs/guides/cluster.md)");
    visit("sbatch", &BatchSettings::sbatch, "slurm: a further option of sbatch, --sbatch=--qos=low (several times)");
  }
};

struct BatchPlan {
  BatchSettings settings;
  std::vector<PlannedEntry> entries;
  std::vector<BatchTask> tasks;
  std::vector<std::string> submitted;  // array jobs of Slurm
  std::string summary_job;             // the one behind them that writes the summary
};

// An attempt at a task, as written by whoever made it.
struct TaskAttempt {
  std::string host, begun, ended;  // UTC; `ended` is empty where it was ended from outside
  std::string job;                 // of Slurm
  int64_t memory_bytes = 0;        // that it was given; 0: not limited
  double wall_seconds = 0, cpu_seconds = 0;
  int64_t peak_memory_bytes = 0;
};

struct TaskRecord {
  // "", "running", "cancelled", "killed", or as JobEndName.
  std::string end;
  std::string reason;
  int exit_code = 0;
  bool out_of_memory = false;
  std::vector<TaskAttempt> attempts;

  bool Ended() const { return !end.empty() && end != "running"; }
  bool Done() const { return end == "computed" || end == "up to date" || end == "not needed"; }
  // Could another attempt with more memory succeed? Not where an error of the input or of the program is named.
  bool WantsMoreMemory() const { return end == "running" || end == "killed" || (end == "failed" && out_of_memory); }
};

// The graph of a list. An entry that cannot be planned keeps its error.
BatchPlan MakeBatchPlan(const Session& session, const std::vector<BatchEntry>& entries, const BatchSettings& settings);
// Throws InputError if the folder holds no batch.
BatchPlan ReadBatchPlan(const std::filesystem::path& folder);
void WriteBatchPlan(const BatchPlan& plan, const std::filesystem::path& folder);

TaskRecord ReadTaskRecord(const std::filesystem::path& folder, size_t task);
// Of a batch that goes on: what is not done begins anew, and so does what came after it, for it read what was there.
std::vector<TaskRecord> BeginTaskRecords(const BatchPlan& plan, const std::filesystem::path& folder);
void WriteTaskRecord(const TaskRecord& record, const std::filesystem::path& folder, size_t task);

// What became of the tasks that `task` needs; one without an end counts as failed.
std::vector<JobResult> NeededResults(const BatchPlan& plan, const std::vector<TaskRecord>& records, size_t task);
Job JobOf(const BatchTask& task);

// What became of an entry. `states`: of every task, its record's end or what the engine knows ("queued").
BatchResult ResultOfEntry(const BatchPlan& plan, const std::vector<TaskRecord>& records,
                          const std::vector<std::string>& states, size_t entry);

// "4G", "800M", "0.5G" in bytes; `option` is named in the OptionError.
int64_t ParseMemory(const std::string& option, const std::string& text);

// Runs task `number` of a batch in this process, and writes its record. `retry`: only where WantsMoreMemory. Returns
// the exit code of the process: 0 also where it is skipped.
int RunBatchTask(const Session& session, const std::filesystem::path& folder, size_t number, bool retry);

// A file in a batch's folder that asks the process which runs it here to stop.
constexpr const char* kCancelFile = "cancel";

// Runs the graph on this machine. Returns when all tasks have ended; throws Cancelled.
void RunBatchLocally(const Session& session, const std::filesystem::path& folder, BatchPlan plan);

// Throws InputError if jobs of the batch are in Slurm's queue.
void RequireNothingQueued(const BatchPlan& plan, const std::filesystem::path& folder);
// Submits every task that is not done to Slurm, and a job that writes the summary behind them. Returns the number of
// groups of tasks.
size_t SubmitToSlurm(const std::filesystem::path& folder, BatchPlan plan);
// The state of every task: its record's end, "running", "queued", or "lost" if nobody runs it any more.
std::vector<std::string> SlurmStates(const BatchPlan& plan, const std::vector<TaskRecord>& records);
// How many jobs of the batch are in Slurm's queue.
size_t SlurmQueued(const BatchPlan& plan);
void CancelInSlurm(const BatchPlan& plan);

}  // namespace trigpoint
