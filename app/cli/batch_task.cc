// One task of a batch: what a machine of a cluster, or a process of this one, runs.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>

#include "app/cli/batch_plan.h"
#include "calib/base/cpu_seconds.h"
#include "calib/base/error.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/forked.h"
#include "datasets/project/stage_task.h"
#include "datasets/project/task_lock.h"

namespace trigpoint {

namespace fs = std::filesystem;

namespace {

// As Slurm names the job: with the index of its array.
std::string SlurmJob() {
  const std::string array = EnvironmentText("SLURM_ARRAY_JOB_ID");
  return array.empty() ? EnvironmentText("SLURM_JOB_ID") : array + "_" + EnvironmentText("SLURM_ARRAY_TASK_ID");
}

TaskAttempt BeginAttempt() {
  TaskAttempt attempt;
  attempt.host = HostName();
  // Several daemons on one machine have names of their own.
  if (const std::string node = EnvironmentText("SLURMD_NODENAME"); !node.empty()) attempt.host = node;
  attempt.begun = UtcTimeText();
  attempt.job = SlurmJob();
  attempt.memory_bytes = ParseInt(EnvironmentText("SLURM_MEM_PER_NODE")).value_or(0) << 20;
  return attempt;
}

// Of this process and those it has waited for.
void EndAttempt(double wall_seconds, TaskAttempt* attempt) {
  attempt->ended = UtcTimeText();
  attempt->wall_seconds = wall_seconds;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    attempt->cpu_seconds += CpuSecondsOf(usage);
    attempt->peak_memory_bytes = std::max(attempt->peak_memory_bytes, static_cast<int64_t>(usage.ru_maxrss) * 1024);
  }
}

JobAttempt RunIt(const Session& session, const BatchPlan& plan, const fs::path& folder, size_t number) {
  const BatchTask& task = plan.tasks[number];
  std::vector<TaskRecord> records(plan.tasks.size());
  for (const size_t need : task.needs) records[need] = ReadTaskRecord(folder, need);
  const Project project = Project::OpenToCompute(task.dir);
  const Job job = JobOf(task);
  if (const auto decided = EndWithoutRunning(project, job, NeededResults(plan, records, number))) return {*decided};
  Terminal terminal = session.MakeTerminal();
  return RunJob(project, job, session.options.threads, task.seed, terminal, *session.cancel, RunStageAsTask);
}

}  // namespace

int RunBatchTask(const Session& session, const fs::path& folder, size_t number, bool retry) {
  const BatchPlan plan = ReadBatchPlan(folder);
  if (number >= plan.tasks.size())
    throw OptionError(fmt::format("batch task {}: expected a task below {}", number, plan.tasks.size()));
  TaskRecord record = ReadTaskRecord(folder, number);
  // What has no record did not even begin.
  if (retry && !record.end.empty() && !record.WantsMoreMemory()) return 0;
  const auto begun = std::chrono::steady_clock::now();
  record.end = "running";
  record.reason = "was ended from outside";  // what is known if nothing else gets written
  record.attempts.push_back(BeginAttempt());
  WriteTaskRecord(record, folder, number);
  const auto end = [&](const std::string& how, const std::string& reason, int exit_code, bool out_of_memory) {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begun;
    EndAttempt(wall.count(), &record.attempts.back());
    record.end = how;
    record.reason = reason;
    record.exit_code = exit_code;
    record.out_of_memory = out_of_memory;
    WriteTaskRecord(record, folder, number);
    return exit_code;
  };
  try {
    const auto [result, out_of_memory] = RunIt(session, plan, folder, number);
    const int exit_code = end(std::string(JobEndName(result.end)), result.reason, result.exit_code, out_of_memory);
    if (result.end == JobEnd::kFailed || result.end == JobEnd::kSkipped)
      session.MakeTerminal().Log(LogLevel::kError, plan.tasks[number].title + ": " + record.end + ": " + record.reason);
    return exit_code;
  } catch (const Cancelled& e) {
    // Slurm ends tasks so that it preempts or whose time is over: another attempt may follow.
    const bool by_slurm = !record.attempts.back().job.empty();
    end(by_slurm ? "running" : "cancelled", by_slurm ? "was ended by Slurm" : "was cancelled", e.ExitCode(), false);
    throw;
  } catch (const Error& e) {
    end("failed", e.what(), e.ExitCode(), dynamic_cast<const MemoryError*>(&e) != nullptr);
    throw;
  }
}

}  // namespace trigpoint
