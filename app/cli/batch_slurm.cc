// The graph of a batch as array jobs of Slurm: one for each project and stage, a second one behind it that tries with
// more memory what failed for lack of it, dependencies between them.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "app/cli/batch_plan.h"
#include "app/pipeline/command_line.h"
#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/lines.h"
#include "datasets/io/text.h"
#include "datasets/project/child_process.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

constexpr double kMoreMemory = 2, kTimeFactor = 3, kTimeFloor_min = 10;

// A program of Slurm with its output; `input` on its standard input. Throws IoError with what it said.
std::string Slurm(const std::vector<std::string>& words, const std::string& input, const fs::path& scratch) {
  if (FindProgram(words.front()).empty()) {
    throw IoError(
        words.front() +
        ": not found in PATH; --engine slurm runs where Slurm's commands are installed (Debian: slurm-client)");
  }
  const fs::path file = scratch / (".slurm-input-" + std::to_string(getpid()));
  if (!input.empty()) WriteFileAtomically(file, input);
  std::string line;
  for (const std::string& word : words) line += ShellWord(word) + " ";
  line += input.empty() ? "</dev/null 2>&1" : "<" + ShellWord(file.string()) + " 2>&1";
  FILE* pipe = popen(line.c_str(), "r");
  if (pipe == nullptr) throw IoError(words.front() + ": cannot be started");
  std::string text;
  std::array<char, 4096> buffer{};
  while (const size_t got = fread(buffer.data(), 1, buffer.size(), pipe)) text.append(buffer.data(), got);
  const int status = pclose(pipe);
  std::error_code ignored;
  if (!input.empty()) fs::remove(file, ignored);
  if (status != 0) throw IoError(words.front() + " failed: " + std::string(Trim(text)));
  return text;
}

// Tasks that one array job runs: those of a project's stage that wait for the same.
struct Group {
  std::vector<size_t> tasks;
  int64_t memory_bytes = 0;
  double minutes = 0;
  std::set<size_t> after;  // groups
  std::string job, retry;  // of Slurm
};

std::vector<Group> GroupsOf(const BatchPlan& plan, const std::vector<TaskRecord>& records, size_t largest) {
  std::vector<Group> groups;
  std::map<size_t, size_t> group_of;  // by task
  std::map<std::string, size_t> open;
  const int64_t unmeasured = ParseMemory("--task-memory", plan.settings.task_memory);
  for (size_t i = 0; i < plan.tasks.size(); ++i) {
    if (records[i].Done()) continue;
    const BatchTask& task = plan.tasks[i];
    std::set<size_t> after;
    for (const size_t earlier : task.after) {
      if (const auto it = group_of.find(earlier); it != group_of.end()) after.insert(it->second);
    }
    // An array waits for those before it.
    const std::string key = task.dir.string() + "\n" + task.stage + "\n" + DumpJson(task.target.overrides);
    auto it = open.find(key);
    if (it == open.end() || groups[it->second].tasks.size() >= largest ||
        (!after.empty() && *after.rbegin() >= it->second))
      it = open.insert_or_assign(key, (groups.emplace_back(), groups.size() - 1)).first;
    Group& group = groups[it->second];
    group.tasks.push_back(i);
    group.after.insert(after.begin(), after.end());
    group.memory_bytes = std::max(group.memory_bytes, task.memory_bytes > 0 ? task.memory_bytes : unmeasured);
    // What was not enough is not tried again; the second attempt has twice as much.
    const std::vector<TaskAttempt>& attempts = records[i].attempts;
    if (!attempts.empty() && (records[i].out_of_memory || attempts.back().ended.empty()))
      group.memory_bytes = std::max(group.memory_bytes, attempts.back().memory_bytes);
    const double minutes =
        task.seconds > 0 ? kTimeFloor_min + kTimeFactor * task.seconds / 60 : plan.settings.task_minutes;
    group.minutes = std::max(group.minutes, minutes);
    group_of[i] = it->second;
  }
  return groups;
}

// The most that a task can be given: more is refused, or waits for ever.
struct Limits {
  int64_t mib = 0;     // 0: not known
  double minutes = 0;  // 0: none
};

// Of Slurm's "1-12:00:00", "60:00", "30"; 0: no limit.
double MinutesOf(const std::string& text) {
  int days = 0, a = 0, b = 0, c = 0;
  const size_t dash = text.find('-');
  const std::string time = dash == std::string::npos ? text : text.substr(dash + 1);
  if (dash != std::string::npos) days = static_cast<int>(ParseInt(text.substr(0, dash)).value_or(0));
  const int fields = std::sscanf(time.c_str(), "%d:%d:%d", &a, &b, &c);
  if (fields < 1) return 0;
  const bool with_hours = fields == 3 || dash != std::string::npos;  // else "minutes" or "minutes:seconds"
  return 1440.0 * days + (with_hours ? 60.0 * a + (fields > 1 ? b : 0) : a);
}

// The largest of all nodes of the partition, of the default one if none is named.
Limits LimitsOf(const BatchSettings& settings, const fs::path& folder) {
  const auto elsewhere = [](const std::string& o) { return o.starts_with("--partition") || o.starts_with("-p"); };
  const bool any = std::any_of(settings.sbatch.begin(), settings.sbatch.end(), elsewhere);
  Limits most;
  bool unlimited = false;
  const std::string nodes = Slurm({"sinfo", "-h", "-N", "-o", "%P %m %l"}, "", folder);
  for (const std::string_view line : Lines(nodes)) {
    const auto fields = SplitFields(line);
    if (fields.size() < 3) continue;
    std::string name(fields[0]);
    const bool is_default = name.ends_with('*');
    if (is_default) name.pop_back();
    if (!any && (settings.partition.empty() ? !is_default : name != settings.partition)) continue;
    most.mib = std::max(most.mib, ParseInt(fields[1]).value_or(0));
    const double minutes = MinutesOf(std::string(fields[2]));
    unlimited = unlimited || minutes == 0;
    most.minutes = std::max(most.minutes, minutes);
  }
  if (unlimited) most.minutes = 0;
  return most;
}

class Submission {
 public:
  Submission(BatchPlan* plan, fs::path folder) : plan_(*plan), folder_(std::move(folder)) {
    program_ = fs::read_symlink("/proc/self/exe").string();
    limits_ = LimitsOf(plan_.settings, folder_);
  }

  // What an array may hold, at most.
  size_t LargestArray() const {
    const std::string config = Slurm({"scontrol", "show", "config"}, "", folder_);
    for (const std::string_view line : Lines(config)) {
      const auto fields = SplitFields(line);
      if (fields.size() >= 3 && fields[0] == "MaxArraySize")
        return static_cast<size_t>(ParseInt(fields[2]).value_or(1));
    }
    constexpr size_t kSlurmDefault = 1001;
    return kSlurmDefault;
  }

  void Submit(std::vector<Group>* groups) {
    try {
      for (Group& group : *groups) {
        const std::string before = Behind(*groups, group.after);
        group.job = SubmitArray(group, before, false);
        group.retry = SubmitArray(group, "afternotok:" + group.job, true);
      }
      std::set<size_t> all;
      for (size_t i = 0; i < groups->size(); ++i) all.insert(i);
      SubmitSummary(Behind(*groups, all));
    } catch (const Error&) {
      CancelInSlurm(plan_);
      throw;
    }
  }

 private:
  static std::string Behind(const std::vector<Group>& groups, const std::set<size_t>& after) {
    std::string text;
    for (const size_t g : after) text += ":" + groups[g].job + ":" + groups[g].retry;
    return text.empty() ? "" : "afterany" + text;
  }

  std::vector<std::string> Common(const std::string& name, const std::string& dependency) const {
    const BatchSettings& s = plan_.settings;
    std::vector<std::string> words = {"sbatch",
                                      "--parsable",
                                      "--requeue",
                                      "--open-mode=append",
                                      "--job-name=trigpoint-" + name,
                                      "--chdir=" + folder_.string()};
    if (!dependency.empty()) words.push_back("--dependency=" + dependency);
    if (!s.partition.empty()) words.push_back("--partition=" + s.partition);
    if (!s.account.empty()) words.push_back("--account=" + s.account);
    words.insert(words.end(), s.sbatch.begin(), s.sbatch.end());
    return words;
  }

  // The program as a node starts it.
  std::string Program() const {
    const BatchSettings& s = plan_.settings;
    if (s.container.empty()) return ShellWord(program_);
    std::set<std::string> folders = {folder_.string()};
    for (const BatchTask& task : plan_.tasks) folders.insert(task.dir.string());
    std::string binds;
    for (const std::string& folder : folders) binds += " --bind " + ShellWord(folder);
    return "\"$(command -v apptainer || command -v singularity)\" exec" + binds + " " + ShellWord(s.container) +
           " trigpoint";
  }

  std::string SubmitArray(const Group& group, const std::string& dependency, bool retry) {
    const BatchSettings& s = plan_.settings;
    const std::string& stage = plan_.tasks[group.tasks.front()].stage;
    const int threads = std::max(1, s.threads);
    const double factor = retry ? kMoreMemory : 1;
    int64_t mib = static_cast<int64_t>(std::ceil(factor * static_cast<double>(group.memory_bytes) / (1 << 20)));
    if (limits_.mib > 0) mib = std::min(mib, limits_.mib);
    double minutes = std::ceil(factor * group.minutes);
    if (minutes == 0 && retry) minutes = limits_.minutes;  // what it ran out of may have been the partition's default
    if (limits_.minutes > 0) minutes = std::min(minutes, limits_.minutes);
    std::vector<std::string> words = Common(stage + (retry ? "-retry" : ""), dependency);
    words.push_back(fmt::format("--array=0-{}", group.tasks.size() - 1));
    words.push_back(fmt::format("--cpus-per-task={}", threads));
    words.push_back(fmt::format("--mem={}M", mib));
    if (minutes > 0) words.push_back(fmt::format("--time={:.0f}", minutes));
    if (retry) words.push_back("--kill-on-invalid-dep=yes");  // goes when nothing failed
    words.push_back("--output=" + (folder_ / "logs" / "slurm_%A_%a.log").string());
    const std::string script = fmt::format(
        "#!/bin/bash\ntasks=({})\nexec {} batch task {} \"${{tasks[$SLURM_ARRAY_TASK_ID]}}\" --threads {}{}\n",
        fmt::join(group.tasks, " "), Program(), ShellWord(folder_.string()), threads, retry ? " --retry" : "");
    plan_.submitted.push_back(SubmitScript(words, script));
    WriteBatchPlan(plan_, folder_);  // so that it can be cancelled, whatever becomes of this process
    return plan_.submitted.back();
  }

  void SubmitSummary(const std::string& dependency) {
    std::vector<std::string> words = Common("summary", dependency);
    words.push_back("--output=" + (folder_ / "logs" / "slurm_%A.log").string());
    words.push_back("--mem=1024M");
    plan_.summary_job = SubmitScript(
        words, fmt::format("#!/bin/bash\nexec {} batch status {} --verbose\n", Program(), ShellWord(folder_.string())));
    WriteBatchPlan(plan_, folder_);
  }

  std::string SubmitScript(const std::vector<std::string>& words, const std::string& script) {
    std::string id = std::string(Trim(Slurm(words, script, folder_)));
    id = id.substr(id.rfind('\n') + 1);  // behind warnings
    id = id.substr(0, id.find(';'));     // of a federation's cluster
    if (!ParseInt(id)) throw IoError("sbatch: expected the number of a job, found: " + id);
    return id;
  }

  BatchPlan& plan_;
  fs::path folder_;
  std::string program_;
  Limits limits_;
};

// Array jobs of the batch in the queue: {"12_3", "RUNNING"}.
std::vector<std::pair<std::string, std::string>> Queue(const BatchPlan& plan) {
  std::vector<std::pair<std::string, std::string>> queue;
  if (plan.submitted.empty()) return queue;
  const std::set<std::string> ours(plan.submitted.begin(), plan.submitted.end());
  const std::string states = Slurm({"squeue", "-h", "-r", "--me", "-o", "%i %T"}, "", {});
  for (const std::string_view line : Lines(states)) {
    const auto fields = SplitFields(line);
    if (fields.size() < 2) continue;
    const std::string id(fields[0]);
    if (ours.count(id.substr(0, id.find('_'))) > 0) queue.emplace_back(id, fields[1]);
  }
  return queue;
}

}  // namespace

size_t SlurmQueued(const BatchPlan& plan) { return Queue(plan).size(); }

void RequireNothingQueued(const BatchPlan& plan, const fs::path& folder) {
  if (const size_t queued = SlurmQueued(plan); queued > 0) {
    throw InputError(fmt::format("{}: {} in the queue; wait for them, or `trigpoint batch cancel {}`", folder.string(),
                                 Counted(queued, "job of this batch is", "jobs of this batch are"),
                                 ShellWord(ShownPath(folder))));
  }
}

size_t SubmitToSlurm(const fs::path& folder, BatchPlan plan) {
  const std::vector<TaskRecord> records = BeginTaskRecords(plan, folder);
  std::set<fs::path> projects;
  for (const BatchTask& task : plan.tasks) projects.insert(task.dir);
  // What killed processes left in the results goes while nobody writes there.
  for (const fs::path& dir : projects) Project::Open(dir).Lock();
  fs::create_directories(folder / "logs");
  Submission submission(&plan, folder);
  std::vector<Group> groups = GroupsOf(plan, records, submission.LargestArray());
  if (!groups.empty()) submission.Submit(&groups);
  return groups.size();
}

std::vector<std::string> SlurmStates(const BatchPlan& plan, const std::vector<TaskRecord>& records) {
  std::set<std::string> running;
  const auto queue = Queue(plan);
  for (const auto& [id, state] : queue) {
    if (state == "RUNNING" || state == "COMPLETING") running.insert(id);
  }
  std::vector<std::string> states;
  for (const TaskRecord& record : records) {
    if (record.Ended()) {
      states.push_back(record.end);
    } else if (record.end == "running") {
      const bool runs = running.count(record.attempts.back().job) > 0;
      // One that was ended from outside waits for its second attempt, or to be requeued.
      states.emplace_back(runs ? "running" : queue.empty() ? "lost" : "queued");
    } else {
      states.emplace_back(!queue.empty() ? "queued" : plan.submitted.empty() ? "waiting" : "lost");
    }
  }
  return states;
}

void CancelInSlurm(const BatchPlan& plan) {
  if (plan.submitted.empty()) return;
  std::vector<std::string> words = {"scancel", "--quiet"};  // those that have ended are no error
  words.insert(words.end(), plan.submitted.begin(), plan.submitted.end());
  if (!plan.summary_job.empty()) words.push_back(plan.summary_job);
  Slurm(words, "", {});
}

}  // namespace trigpoint
