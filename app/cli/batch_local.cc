// Runs the graph of a batch on this machine, each task in its own process, so that a crash of one spares the others.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <thread>

#include "app/cli/batch_plan.h"
#include "calib/base/cpu_seconds.h"
#include "calib/base/memory.h"
#include "calib/base/parallel.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// Resident memory of every process, by process group. A child leads a group of its own.
std::map<pid_t, int64_t> MemoryByGroup() {
  static const int64_t kPage = sysconf(_SC_PAGESIZE);
  std::map<pid_t, int64_t> memory;
  std::error_code ignored;
  for (fs::directory_iterator it("/proc", ignored), end; it != end; it.increment(ignored)) {
    if (!ParseInt(it->path().filename().string())) continue;
    std::ifstream file(it->path() / "stat");
    std::string text;
    if (!std::getline(file, text)) continue;
    const size_t name_end = text.rfind(')');  // a name may hold anything
    if (name_end == std::string::npos) continue;
    const auto fields = SplitFields(std::string_view(text).substr(name_end + 1));
    constexpr size_t kGroup = 2, kResident = 21;  // counted from the state
    if (fields.size() <= kResident) continue;
    memory[static_cast<pid_t>(ParseInt(fields[kGroup]).value_or(0))] += ParseInt(fields[kResident]).value_or(0) * kPage;
  }
  return memory;
}

class LocalBatch {
 public:
  LocalBatch(const Session& session, fs::path folder, BatchPlan plan)
      : session_(session), folder_(std::move(folder)), plan_(std::move(plan)), terminal_(session.MakeTerminal()) {
    cores_ = ResolveThreads(plan_.settings.threads);
    jobs_ = std::max(1, plan_.settings.jobs > 0 ? plan_.settings.jobs : cores_);
    limit_ = plan_.settings.memory.empty() ? AvailableMemoryBytes() * 8 / 10
                                           : ParseMemory("--memory", plan_.settings.memory);
    records_ = BeginTaskRecords(plan_, folder_);
    fs::create_directories(folder_ / "logs");
    fs::remove(folder_ / kCancelFile);
  }

  void Run() {
    terminal_.Say(fmt::format("{}: {} at a time within {:.0f} MiB", Counted(plan_.tasks.size(), "task"), jobs_,
                              Mebibytes(limit_)));
    for (size_t k = 0; k < plan_.entries.size(); ++k) TellOf(k);
    while (true) {
      if (session_.cancel->IsCancelled() || fs::exists(folder_ / kCancelFile)) Cancel();
      while (StartOne()) {
      }
      if (running_.empty()) break;
      Reap();
      WatchMemory();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

 private:
  struct Child {
    pid_t pid = 0;
    size_t task = 0;
    Clock::time_point begun;
    int64_t memory = 0, peak = 0;
    bool evicted = false;
  };

  bool Ready(size_t task) const {
    if (records_[task].Ended() || started_.count(task) > 0) return false;
    const std::vector<size_t>& after = plan_.tasks[task].after;
    return std::all_of(after.begin(), after.end(), [&](size_t earlier) { return records_[earlier].Ended(); });
  }

  // Expected memory of a task: as measured before, else the largest of all tasks so far, at first an equal share of the
  // limit.
  int64_t Expected(size_t task) const {
    if (plan_.tasks[task].memory_bytes > 0) return plan_.tasks[task].memory_bytes;
    return most_ > 0 ? most_ : limit_ / jobs_;
  }

  // Starts the next task that may run now, within the memory limit. One that was stopped for its memory runs alone.
  bool StartOne() {
    if (static_cast<int>(running_.size()) >= jobs_) return false;
    int64_t committed = 0;
    for (const Child& child : running_) {
      if (alone_.count(child.task) > 0) return false;
      committed += std::max(child.memory, Expected(child.task));
    }
    std::vector<size_t> ready;
    for (size_t i = 0; i < plan_.tasks.size(); ++i) {
      if (Ready(i)) ready.push_back(i);
    }
    for (const size_t i : ready) {
      if (!running_.empty() && (alone_.count(i) > 0 || committed + Expected(i) > limit_)) continue;
      if (Skip(i)) return true;
      // The cores are shared by the tasks that can run at the same time; results do not depend on the number of
      // threads.
      const auto beside = std::min(static_cast<size_t>(jobs_), running_.size() + ready.size());
      Start(i, std::max(1, cores_ / static_cast<int>(beside)));
      return true;
    }
    return false;
  }

  // Ends a task without a process if results that it needs were not made.
  bool Skip(size_t task) {
    const std::vector<size_t>& needs = plan_.tasks[task].needs;
    if (std::all_of(needs.begin(), needs.end(), [&](size_t need) { return records_[need].Done(); })) return false;
    const auto decided = EndWithoutRunning(Project::Open(plan_.tasks[task].dir), JobOf(plan_.tasks[task]),
                                           NeededResults(plan_, records_, task));
    if (!decided) return false;
    TaskRecord record = records_[task];
    record.reason = decided->reason;
    SetRecord(task, record, std::string(JobEndName(decided->end)));
    Tell(task);
    return true;
  }

  void Start(size_t task, int threads) {
    std::vector<std::string> words = {
        "trigpoint", "batch", "task", folder_.string(), std::to_string(task), "--threads", std::to_string(threads)};
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string log = LogOf(task).string();
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid < 0) throw IoError("no further process can be started: fewer --jobs may help");
    if (pid == 0) {
      setpgid(0, 0);
      prctl(PR_SET_PDEATHSIG, SIGKILL);  // nothing outlives the batch; finished stages are kept
      if (getppid() != parent) _exit(1);
      std::signal(SIGINT, SIG_DFL);
      std::signal(SIGTERM, SIG_DFL);
      constexpr int kMode = 0644;
      dup2(open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, kMode), STDERR_FILENO);
      dup2(STDERR_FILENO, STDOUT_FILENO);
      execv("/proc/self/exe", argv.data());
      _exit(127);
    }
    setpgid(pid, pid);
    started_.insert(task);
    Child child;
    child.pid = pid;
    child.task = task;
    child.begun = Clock::now();
    running_.push_back(child);
  }

  fs::path LogOf(size_t task) const { return folder_ / "logs" / fmt::format("task_{:05}.log", task + 1); }

  void Reap() {
    for (size_t k = 0; k < running_.size();) {
      int status = 0;
      rusage usage{};
      if (wait4(running_[k].pid, &status, WNOHANG, &usage) != running_[k].pid) {
        ++k;
        continue;
      }
      const Child child = running_[k];
      running_.erase(running_.begin() + static_cast<ptrdiff_t>(k));
      Finish(child, status, usage);
    }
  }

  void Finish(const Child& child, int status, const rusage& usage) {
    const size_t task = child.task;
    TaskRecord record = ReadTaskRecord(folder_, task);
    most_ = std::max(most_, child.peak);
    if (!record.Ended()) {  // the process ended before it wrote its record
      if (record.attempts.empty() || !record.attempts.back().ended.empty()) record.attempts.emplace_back();
      TaskAttempt& attempt = record.attempts.back();
      attempt.ended = UtcTimeText();
      attempt.wall_seconds = std::chrono::duration<double>(Clock::now() - child.begun).count();
      attempt.cpu_seconds += CpuSecondsOf(usage);
      attempt.peak_memory_bytes = child.peak;
      record.end = WIFSIGNALED(status) ? "killed" : "failed";
      record.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
      record.reason = WhyEnded(child, status);
    }
    records_[task] = record;
    if (record.WantsMoreMemory() && alone_.insert(task).second) {  // once more, alone: all memory is its own
      terminal_.Say(Name(task) + ": " + record.reason + "; restarted with no other task beside it");
      SetRecord(task, record, "");
      started_.erase(task);
      return;
    }
    if (record.end == "killed") record.reason += child.evicted ? ", even with no other task beside it" : ", twice";
    SetRecord(task, record, record.end == "killed" ? "failed" : record.end);
    if (records_[task].end == "failed") terminal_.Say(Name(task) + ": failed: " + records_[task].reason);
    Tell(task);
  }

  // The entries that a task which has ended belongs to.
  void Tell(size_t task) {
    for (size_t k = 0; k < plan_.entries.size(); ++k) {
      const std::vector<size_t>& tasks = plan_.entries[k].tasks;
      if (std::find(tasks.begin(), tasks.end(), task) != tasks.end()) TellOf(k);
    }
  }

  std::string WhyEnded(const Child& child, int status) const {
    if (child.evicted) {
      return fmt::format("needs more than the memory limit of {:.0f} MiB", Mebibytes(limit_));
    }
    if (WIFSIGNALED(status))
      return fmt::format("was ended by signal {} ({})", WTERMSIG(status), strsignal(WTERMSIG(status)));
    const std::string text(Trim(ReadTextFile(LogOf(child.task))));
    const size_t line = text.rfind('\n');
    return line == std::string::npos ? text : text.substr(line + 1);
  }

  void SetRecord(size_t task, TaskRecord record, const std::string& end) {
    record.end = end;
    SetRecord(task, record);
  }
  void SetRecord(size_t task, const TaskRecord& record) {
    records_[task] = record;
    WriteTaskRecord(record, folder_, task);
  }
  std::string Name(size_t task) const {
    return plan_.tasks[task].dir.filename().string() + " " + plan_.tasks[task].title;
  }

  // A line for an entry whose tasks have all ended.
  void TellOf(size_t entry) {
    const PlannedEntry& planned = plan_.entries[entry];
    const bool ended =
        std::all_of(planned.tasks.begin(), planned.tasks.end(), [&](size_t task) { return records_[task].Ended(); });
    if (!ended || !told_.insert(entry).second) return;
    std::vector<std::string> states;
    for (const TaskRecord& record : records_) states.push_back(record.end);
    const BatchResult result = ResultOfEntry(plan_, records_, states, entry);
    terminal_.Say(result.entry.name + ": " + result.status + (result.error.empty() ? "" : ": " + result.error));
  }

  // Over the limit, the task that began last is stopped and done again later, alone.
  void WatchMemory() {
    const std::map<pid_t, int64_t> groups = MemoryByGroup();
    int64_t sum = 0;
    for (Child& child : running_) {
      const auto it = groups.find(child.pid);
      child.memory = it == groups.end() ? 0 : it->second;
      child.peak = std::max(child.peak, child.memory);
      if (!child.evicted) sum += child.memory;
    }
    constexpr double kMargin = 0.97;
    if (running_.empty() || static_cast<double>(sum) <= kMargin * static_cast<double>(limit_)) return;
    const auto youngest = std::max_element(running_.begin(), running_.end(), [](const Child& a, const Child& b) {
      return std::pair(!a.evicted, a.begun) < std::pair(!b.evicted, b.begun);
    });
    if (youngest->evicted) return;
    youngest->evicted = true;
    kill(-youngest->pid, SIGKILL);
  }

  [[noreturn]] void Cancel() {
    for (const Child& child : running_) kill(-child.pid, SIGTERM);
    const Clock::time_point deadline = Clock::now() + std::chrono::seconds(20);
    for (const Child& child : running_) {
      int status = 0;
      while (waitpid(child.pid, &status, WNOHANG) == 0) {
        if (Clock::now() > deadline) kill(-child.pid, SIGKILL);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      records_[child.task] = ReadTaskRecord(folder_, child.task);
    }
    for (size_t i = 0; i < records_.size(); ++i) {
      if (!records_[i].Ended()) SetRecord(i, records_[i], "cancelled");
    }
    fs::remove(folder_ / kCancelFile);
    throw Cancelled();
  }

  const Session& session_;
  fs::path folder_;
  BatchPlan plan_;
  Terminal terminal_;
  int cores_ = 1, jobs_ = 1;
  int64_t limit_ = 0, most_ = 0;
  std::vector<TaskRecord> records_;
  std::vector<Child> running_;
  std::set<size_t> started_, alone_, told_;
};

}  // namespace

void RunBatchLocally(const Session& session, const fs::path& folder, BatchPlan plan) {
  LocalBatch(session, folder, std::move(plan)).Run();
}

}  // namespace trigpoint
