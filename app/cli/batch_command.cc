// batch: many projects, each in a process of its own, so that whatever happens to one is kept apart from the others.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <thread>

#include "app/cli/batch_list.h"
#include "app/cli/command.h"
#include "calib/base/memory.h"
#include "calib/base/parallel.h"
#include "datasets/io/text.h"
#include "eval/report/overview.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct BatchArguments {
  std::string list, out, memory;
  int jobs = 0;
};

// "4G", "800M", "0.5G" in bytes.
int64_t ParseMemory(const std::string& text) {
  const std::string unit = text.empty() ? "" : text.substr(text.size() - 1);
  const double factor = unit == "G" || unit == "g" ? 1 << 30 : unit == "M" || unit == "m" ? 1 << 20 : 0;
  const auto number = ParseDouble(std::string_view(text).substr(0, text.empty() ? 0 : text.size() - 1));
  if (factor == 0 || !number || !(*number > 0))
    throw OptionError("--memory " + text + ": expected a size like 4G or 800M");
  return static_cast<int64_t>(*number * factor);
}

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

class Batch {
 public:
  Batch(const Session& session, std::vector<BatchEntry> entries, const BatchArguments& arguments)
      : session_(session), terminal_(session.MakeTerminal()) {
    out_ = arguments.out;
    const int cores = ResolveThreads(session.options.threads);
    jobs_ = std::max(1, std::min(arguments.jobs > 0 ? arguments.jobs : cores, static_cast<int>(entries.size())));
    threads_ = std::max(1, cores / jobs_);
    limit_ = arguments.memory.empty() ? AvailableMemoryBytes() * 8 / 10 : ParseMemory(arguments.memory);
    for (BatchEntry& entry : entries) results_.emplace_back().entry = std::move(entry);
    RequireBatchFolder(out_);
    WriteBatchSummary(results_, out_);
    fs::create_directories(out_ / "logs");
  }

  int Run() {
    terminal_.Say(fmt::format("{} projects, {} at a time with {} threads each, within {:.0f} MiB", results_.size(),
                              jobs_, threads_, static_cast<double>(limit_) / (1 << 20)));
    while (true) {
      if (session_.cancel->IsCancelled()) return Cancel();
      while (StartOne()) {
      }
      if (running_.empty()) break;
      Reap();
      WatchMemory();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    WriteBatchSummary(results_, out_);
    WriteOverviewPage();
    return ExitCode();
  }
  const std::vector<BatchResult>& results() const { return results_; }

 private:
  struct Child {
    pid_t pid = 0;
    size_t index = 0;
    Clock::time_point begun;
    int64_t memory = 0, peak = 0;
    bool evicted = false;
  };

  // What a project is thought to need: the most that any has needed, a fair share of the limit at first.
  int64_t Expected() const { return most_ > 0 ? most_ : limit_ / jobs_; }

  // Starts the next project that may run now: one process a project, within the memory limit. One that was stopped for
  // its memory runs alone.
  bool StartOne() {
    if (static_cast<int>(running_.size()) >= jobs_) return false;
    int64_t committed = 0;
    for (const Child& child : running_) {
      if (alone_.count(child.index) > 0) return false;
      committed += std::max(child.memory, Expected());
    }
    if (!running_.empty() && committed + Expected() > limit_) return false;
    for (size_t i = 0; i < results_.size(); ++i) {
      if (results_[i].status != "waiting" || started_.count(i) > 0) continue;
      if (alone_.count(i) > 0 && !running_.empty()) continue;
      const bool busy = std::any_of(running_.begin(), running_.end(), [&](const Child& child) {
        return results_[child.index].entry.dir == results_[i].entry.dir;
      });
      if (busy) continue;
      Start(i);
      return true;
    }
    return false;
  }

  fs::path LogOf(size_t index, const char* end) const {
    return out_ / "logs" / fmt::format("{:04}.{}", index + 1, end);
  }

  void Start(size_t index) {
    const BatchEntry& entry = results_[index].entry;
    std::vector<std::string> words = {"trigpoint", "run", entry.dir.string()};
    words.insert(words.end(), entry.arguments.begin(), entry.arguments.end());
    words.insert(words.end(),
                 {"--json", "--threads", std::to_string(threads_), "--seed", std::to_string(session_.options.seed)});
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string out = LogOf(index, "json").string(), err = LogOf(index, "err").string();
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
      dup2(open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, kMode), STDOUT_FILENO);
      dup2(open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, kMode), STDERR_FILENO);
      execv("/proc/self/exe", argv.data());
      _exit(127);
    }
    setpgid(pid, pid);
    started_.insert(index);
    ++results_[index].attempts;
    Child child;
    child.pid = pid;
    child.index = index;
    child.begun = Clock::now();
    running_.push_back(child);
  }

  void Reap() {
    for (size_t k = 0; k < running_.size();) {
      int status = 0;
      if (waitpid(running_[k].pid, &status, WNOHANG) != running_[k].pid) {
        ++k;
        continue;
      }
      const Child child = running_[k];
      running_.erase(running_.begin() + static_cast<ptrdiff_t>(k));
      Finish(child, status);
    }
  }

  void Finish(const Child& child, int status) {
    BatchResult& r = results_[child.index];
    r.seconds += std::chrono::duration<double>(Clock::now() - child.begun).count();
    r.peak_memory_bytes = std::max(r.peak_memory_bytes, child.peak);
    if (child.evicted) {
      if (alone_.insert(child.index).second) {  // once more, alone
        started_.erase(child.index);
        return;
      }
      r.status = "failed";
      r.exit_code = 1;
      r.error = fmt::format("needs more than the memory limit of {:.0f} MiB, even alone",
                            static_cast<double>(limit_) / (1 << 20));
    } else {
      most_ = std::max(most_, child.peak);
      const nlohmann::json said = nlohmann::json::parse(ReadTextFile(LogOf(child.index, "json")), nullptr, false);
      if (said.is_object()) r.stages = said.value("stages", nlohmann::json::array());
      if (WIFSIGNALED(status) && r.attempts < 2) {  // once more: what it had finished is kept
        terminal_.Say(fmt::format("{}: was ended by signal {} ({}); begun again", r.entry.name, WTERMSIG(status),
                                  strsignal(WTERMSIG(status))));
        started_.erase(child.index);
        return;
      }
      if (WIFSIGNALED(status)) {
        r.exit_code = 128 + WTERMSIG(status);
        r.error = fmt::format("was ended by signal {} ({}), twice", WTERMSIG(status), strsignal(WTERMSIG(status)));
      } else {
        r.exit_code = WEXITSTATUS(status);
        if (r.exit_code != 0 && r.exit_code != kGateExitCode) r.error = ErrorOf(said, child.index);
      }
      r.status = r.exit_code == 0 ? "done" : r.exit_code == kGateExitCode ? "gate" : "failed";
    }
    terminal_.Say(r.entry.name + ": " + r.status + (r.error.empty() ? "" : ": " + r.error));
    WriteBatchSummary(results_, out_);  // at any moment the summary is of what is known
  }

  // The first failure of a run, or the last line it said.
  std::string ErrorOf(const nlohmann::json& said, size_t index) const {
    if (said.is_object()) {
      if (said.contains("error")) return said["error"];
      for (const nlohmann::json& stage : said.value("stages", nlohmann::json::array())) {
        if (stage.value("status", "") == "failed") return stage.value("stage", "") + ": " + stage.value("reason", "");
      }
    }
    std::string text = ReadTextFile(LogOf(index, "err"));
    text = std::string(Trim(text));
    const size_t line = text.rfind('\n');
    return line == std::string::npos ? text : text.substr(line + 1);
  }

  // Over the limit, the project that began last is stopped and done again later, alone.
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
    if (static_cast<double>(sum) <= kMargin * static_cast<double>(limit_)) return;
    const auto youngest = std::max_element(running_.begin(), running_.end(), [](const Child& a, const Child& b) {
      return std::pair(!a.evicted, a.begun) < std::pair(!b.evicted, b.begun);
    });
    if (youngest->evicted) return;
    youngest->evicted = true;
    most_ = std::max(most_, youngest->peak);
    kill(-youngest->pid, SIGKILL);
  }

  int Cancel() {
    for (const Child& child : running_) kill(-child.pid, SIGTERM);
    const Clock::time_point deadline = Clock::now() + std::chrono::seconds(20);
    for (const Child& child : running_) {
      int status = 0;
      while (waitpid(child.pid, &status, WNOHANG) == 0) {
        if (Clock::now() > deadline) kill(-child.pid, SIGKILL);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      results_[child.index].status = "cancelled";
      results_[child.index].exit_code = 130;
    }
    WriteBatchSummary(results_, out_);
    throw Cancelled();
  }

  // index.html: a row for every line of the list, linked to the projects' own reports.
  void WriteOverviewPage() const {
    std::vector<OverviewProject> projects;
    for (const BatchResult& r : results_) {
      OverviewProject project{r.entry.dir, r.status, r.error, r.entry.name, ""};
      const auto& words = r.entry.arguments;
      const auto variant = std::find(words.begin(), words.end(), "--variant");
      if (variant != words.end() && variant + 1 != words.end()) project.variant = variant[1];
      projects.push_back(std::move(project));
    }
    WriteOverview(projects, DisplayUnitNamed(session_.options.units), out_ / "index.html");
  }

  int ExitCode() const {
    int code = 0;
    for (const BatchResult& r : results_) {
      if (r.status == "failed") return 1;
      if (r.status == "gate") code = kGateExitCode;
    }
    return code;
  }

  const Session& session_;
  Terminal terminal_;
  fs::path out_;
  int jobs_ = 1, threads_ = 1;
  int64_t limit_ = 0, most_ = 0;
  std::vector<BatchResult> results_;
  std::vector<Child> running_;
  std::set<size_t> started_, alone_;
};

int RunBatch(const Session& session, BatchArguments arguments) {
  std::vector<BatchEntry> entries = ReadBatchList(arguments.list);
  if (arguments.out.empty()) {
    const fs::path list = arguments.list;
    arguments.out = fs::is_regular_file(list) ? (list.parent_path() / (list.stem().string() + "-batch")).string()
                                              : std::string("trigpoint-batch");
  }
  Batch batch(session, std::move(entries), arguments);
  const int exit_code = batch.Run();
  session.PrintDetails(FormatBatch(batch.results()) + "\n");
  session.End(BatchEnding(batch.results(), session.Taken())
                  .Look("Summary", fs::path(arguments.out) / "summary.md")
                  .Look("Reports", fs::path(arguments.out) / "index.html"));
  nlohmann::json summary = BatchJson(batch.results());
  summary["command"] = "batch";
  summary["ok"] = exit_code == 0;
  summary["exit_code"] = exit_code;
  session.PrintJson(summary);
  return exit_code;
}

}  // namespace

void AddBatchCommand(CLI::App& app, Session& session) {
  CLI::App& command = AddCommand(
      app, session, "batch", "run many projects, runs and variants with nobody watching; one summary",
      "LIST is a file with one project a line (options of `trigpoint run` behind it), or a pattern of folders in "
      "quotes.\n"
      "Every project runs in a process of its own, --jobs at a time within --memory; one that fails doesn't stop the\n"
      "others. After a kill the same command goes on: what is up to date is not computed again. summary.json, .csv "
      "and\n"
      ".md are in --out, and index.html, a page that links to all reports. One that is ended by a signal is begun "
      "once\n"
      "more. The exit code is 1 if one failed, else 3 if a gate of one is not passed.\n\n"
      "Examples:\n"
      "  trigpoint batch sites.txt --jobs 2 --memory 6G\n"
      "  trigpoint batch \"/data/sites/*\"\n"
      "A line of sites.txt:\n"
      "  street_a --run monday --variant trial --set localize.max_distance_m=20");
  const auto a = std::make_shared<BatchArguments>();
  command.add_option("LIST", a->list, "a list file, or a pattern of folders in quotes")->required();
  command.add_option("--jobs", a->jobs, "projects at a time; 0: one a core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command.add_option("--memory", a->memory,
                     "limit of all projects together, 4G or 800M; default: 80 % of what is free");
  command.add_option("--out", a->out, "where the summary goes; default: beside the list, <list>-batch");
  command.callback([&session, a] { session.action = [a](Session& s) { return RunBatch(s, *a); }; });
}

}  // namespace trigpoint
