#include "app/cli/batch_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "app/pipeline/gates_stage.h"
#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

// In JSON under their members' names.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TaskAttempt, host, begun, ended, job, memory_bytes, wall_seconds, cpu_seconds,
                                   peak_memory_bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TaskRecord, end, reason, exit_code, out_of_memory, attempts)

namespace {

constexpr const char* kPlanSchema = "trigpoint batch plan 1";

fs::path PlanFile(const fs::path& folder) { return folder / "batch.json"; }
fs::path RecordFile(const fs::path& folder, size_t task) {
  return folder / "tasks" / fmt::format("{:05}.json", task + 1);
}

// Adds tasks of one entry after another, each result once.
class Planner {
 public:
  explicit Planner(const Session& session, BatchPlan* plan) : session_(session), plan_(*plan) {}

  void Add(const BatchEntry& entry) {
    PlannedEntry planned{entry, "", 0, {}};
    try {
      AddTasks(entry, &planned.tasks);
    } catch (const Error& e) {
      planned.error = e.what();
      planned.exit_code = e.ExitCode();
    }
    plan_.entries.push_back(std::move(planned));
  }

 private:
  void AddTasks(const BatchEntry& entry, std::vector<size_t>* tasks) {
    CLI::App options;
    RunArguments arguments;
    uint64_t seed = session_.options.seed;
    AddRunOptions(options, &arguments);
    options.add_option("--seed", seed);
    try {
      options.parse(std::vector<std::string>(entry.arguments.rbegin(), entry.arguments.rend()));
    } catch (const CLI::ParseError& e) {
      throw OptionError(entry.name + ": " + e.what() + "; expected --run, --variant, --set or --seed");
    }
    const Project project = Project::Open(entry.dir);
    CheckProjectOptions(project);
    const std::vector<Job> jobs = WithGates(project, JobsOf(project, arguments));
    const std::vector<JobNeeds> needs = NeedsOf(project, jobs);
    // Entries of a project with the same options behind each other share what they have in common; those with others
    // wait for them, for they may write the same results.
    const std::string dir = project.dir().string(),
                      options_text = DumpJson(ParseOverrides(arguments.settings, "")) + " " + std::to_string(seed);
    auto& [last, count] = last_[dir];
    if (last != options_text) ++count;
    last = options_text;
    const std::string group = dir + "\n" + std::to_string(count);
    std::vector<size_t> before;
    for (size_t i = 0; i < plan_.tasks.size(); ++i) {
      if (plan_.tasks[i].dir == project.dir() && groups_[i] != group) before.push_back(i);
    }
    std::vector<size_t> ids;
    for (size_t k = 0; k < jobs.size(); ++k) {
      const auto [known, fresh] = ids_.try_emplace(group + "\n" + jobs[k].Title(), plan_.tasks.size());
      if (fresh) {
        plan_.tasks.push_back({project.dir(), jobs[k].stage->name, jobs[k].Title(), jobs[k].target, seed, {}, before});
        groups_.push_back(group);
      }
      ids.push_back(known->second);
      for (const size_t need : needs[k].needs) Join(ids[need], &plan_.tasks[known->second].needs);
      for (const size_t after : needs[k].after) Join(ids[after], &plan_.tasks[known->second].after);
    }
    *tasks = std::move(ids);
  }
  static void Join(size_t id, std::vector<size_t>* ids) {
    if (std::find(ids->begin(), ids->end(), id) == ids->end()) ids->push_back(id);
  }

  const Session& session_;
  BatchPlan& plan_;
  std::map<std::string, std::pair<std::string, int>> last_;  // by project: options of its last entry, and how many
  std::map<std::string, size_t> ids_;                        // by group and title
  std::vector<std::string> groups_;                          // of each task
};

// What tasks are thought to need: what their own result needed when it was made last, else the most that another result
// of their stage did.
void EstimateNeeds(BatchPlan* plan) {
  constexpr double kSameMemory = 1.25, kOtherMemory = 1.5, kOtherTime = 2;
  constexpr int64_t kFloor = int64_t{64} << 20;
  std::map<std::string, std::pair<int64_t, double>> most;  // by stage
  std::vector<bool> own(plan->tasks.size(), false);
  std::map<fs::path, Project> projects;
  for (size_t i = 0; i < plan->tasks.size(); ++i) {
    BatchTask& task = plan->tasks[i];
    const auto project = projects.try_emplace(task.dir, Project::Open(task.dir)).first;
    const Job job = JobOf(task);
    const auto manifest = ReadManifest(project->second, task.stage, ResultName(*job.stage, task.target));
    if (!manifest) continue;
    const int64_t peak = manifest->value("peak_memory_bytes", int64_t{0});
    const int then = std::max(1, manifest->value("threads", 1)), now = ResolveThreads(plan->settings.threads);
    // Threads hold images of their own; CPU time is that of fewer threads.
    const double memory = static_cast<double>(peak) * std::max(1.0, static_cast<double>(now) / then);
    task.seconds = std::max(manifest->value("wall_seconds", 0.0), manifest->value("cpu_seconds", 0.0) / now);
    task.memory_bytes = static_cast<int64_t>(kSameMemory * memory) + kFloor;
    own[i] = true;
    auto& [bytes, seconds] = most[task.stage];
    bytes = std::max(bytes, static_cast<int64_t>(kOtherMemory * memory) + kFloor);
    seconds = std::max(seconds, kOtherTime * task.seconds);
  }
  for (size_t i = 0; i < plan->tasks.size(); ++i) {
    const auto measured = most.find(plan->tasks[i].stage);
    if (own[i] || measured == most.end()) continue;
    std::tie(plan->tasks[i].memory_bytes, plan->tasks[i].seconds) = measured->second;
  }
}

json JsonOf(const BatchSettings& settings) {
  json j;
  BatchSettings::VisitMembers([&](const char* name, auto member, const char*) { j[name] = settings.*member; });
  return j;
}

BatchSettings SettingsFrom(const json& j) {
  BatchSettings settings;
  BatchSettings::VisitMembers([&](const char* name, auto member, const char*) { j.at(name).get_to(settings.*member); });
  return settings;
}

json JsonOf(const BatchTask& t) {
  return {{"dir", t.dir.string()},
          {"stage", t.stage},
          {"title", t.title},
          {"run", t.target.run},
          {"variant", t.target.variant},
          {"overrides", t.target.overrides},
          {"part", t.target.part},
          {"seed", t.seed},
          {"needs", t.needs},
          {"after", t.after},
          {"memory_bytes", t.memory_bytes},
          {"seconds", t.seconds}};
}

BatchTask TaskFrom(const json& j) {
  return {j.at("dir").get<std::string>(),
          j.at("stage"),
          j.at("title"),
          {j.at("run"), j.at("variant"), j.at("overrides"), j.value("part", "")},
          j.at("seed"),
          j.at("needs"),
          j.at("after"),
          j.at("memory_bytes"),
          j.at("seconds")};
}

JobEnd EndNamed(const std::string& name) {
  for (const JobEnd end : {JobEnd::kComputed, JobEnd::kUpToDate, JobEnd::kNotNeeded, JobEnd::kSkipped}) {
    if (JobEndName(end) == name) return end;
  }
  return JobEnd::kFailed;
}

// A task's result as RunJob gave it.
JobResult ResultOfTask(const Project& project, const BatchTask& task, const TaskRecord& record) {
  JobResult result;
  result.job = JobOf(task);
  result.end = EndNamed(record.end);
  result.reason = record.reason;
  result.exit_code = result.end == JobEnd::kFailed ? std::max(1, record.exit_code) : 0;
  const std::string name = ResultName(*result.job.stage, task.target);
  result.outcome.dir = project.ResultDir(task.stage, name);
  result.outcome.manifest = ReadManifest(project, task.stage, name).value_or(json::object());
  for (const char* member : {"metrics", "warnings"}) {
    if (!result.outcome.manifest.contains(member))
      result.outcome.manifest[member] = std::string(member) == "metrics" ? json::object() : json::array();
  }
  return result;
}

// Adds what the attempts of a task took to an entry and to its stage.
void AddCosts(const TaskRecord& record, BatchResult* result, json* stage) {
  double wall = 0, cpu = 0;
  int64_t peak = 0;
  for (const TaskAttempt& attempt : record.attempts) {
    wall += attempt.wall_seconds;
    cpu += attempt.cpu_seconds;
    peak = std::max(peak, attempt.peak_memory_bytes);
  }
  result->seconds += wall;
  result->cpu_seconds += cpu;
  result->peak_memory_bytes = std::max(result->peak_memory_bytes, peak);
  result->attempts = std::max(result->attempts, static_cast<int>(record.attempts.size()));
  (*stage)["wall_seconds"] = wall;
  (*stage)["cpu_seconds"] = cpu;
  (*stage)["peak_memory_bytes"] = peak;
  (*stage)["attempts"] = record.attempts.size();
}

// Each task behind those that it waits for: entries of a project share tasks, which later ones may join.
void SortTasks(BatchPlan* plan) {
  const size_t count = plan->tasks.size();
  std::vector<size_t> order, place(count, count);
  while (order.size() < count) {
    const size_t before = order.size();
    for (size_t i = 0; i < count; ++i) {
      const std::vector<size_t>& after = plan->tasks[i].after;
      const bool ready = std::all_of(after.begin(), after.end(), [&](size_t k) { return place[k] < count; });
      if (place[i] < count || !ready) continue;
      place[i] = order.size();
      order.push_back(i);
    }
    if (order.size() == before) throw InputError("batch: tasks wait for each other");
  }
  const auto renumber = [&](std::vector<size_t>* ids) {
    for (size_t& id : *ids) id = place[id];
  };
  std::vector<BatchTask> sorted;
  for (const size_t i : order) sorted.push_back(std::move(plan->tasks[i]));
  plan->tasks = std::move(sorted);
  for (BatchTask& task : plan->tasks) {
    renumber(&task.needs);
    renumber(&task.after);
  }
  for (PlannedEntry& entry : plan->entries) renumber(&entry.tasks);
}

}  // namespace

Job JobOf(const BatchTask& task) { return {&StageNamed(task.stage), task.target}; }

int64_t ParseMemory(const std::string& option, const std::string& text) {
  const std::string unit = text.empty() ? "" : text.substr(text.size() - 1);
  const double factor = unit == "G" || unit == "g" ? 1 << 30 : unit == "M" || unit == "m" ? 1 << 20 : 0;
  const auto number = ParseDouble(std::string_view(text).substr(0, text.empty() ? 0 : text.size() - 1));
  if (factor == 0 || !number || !(*number > 0))
    throw OptionError(option + " " + text + ": expected a size like 4G or 800M");
  return static_cast<int64_t>(*number * factor);
}

BatchPlan MakeBatchPlan(const Session& session, const std::vector<BatchEntry>& entries, const BatchSettings& settings) {
  BatchPlan plan;
  plan.settings = settings;
  Planner planner(session, &plan);
  for (const BatchEntry& entry : entries) planner.Add(entry);
  SortTasks(&plan);
  EstimateNeeds(&plan);
  return plan;
}

void WriteBatchPlan(const BatchPlan& plan, const fs::path& folder) {
  json entries = json::array(), tasks = json::array();
  for (const PlannedEntry& e : plan.entries) {
    entries.push_back({{"name", e.entry.name},
                       {"dir", e.entry.dir.string()},
                       {"arguments", e.entry.arguments},
                       {"error", e.error},
                       {"exit_code", e.exit_code},
                       {"tasks", e.tasks}});
  }
  for (const BatchTask& task : plan.tasks) tasks.push_back(JsonOf(task));
  WriteFileAtomically(PlanFile(folder), DumpJson({{"schema", kPlanSchema},
                                                  {"settings", JsonOf(plan.settings)},
                                                  {"submitted", plan.submitted},
                                                  {"summary_job", plan.summary_job},
                                                  {"entries", entries},
                                                  {"tasks", tasks}},
                                                 1) +
                                            "\n");
}

BatchPlan ReadBatchPlan(const fs::path& folder) {
  const fs::path file = PlanFile(folder);
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored))
    throw InputError(folder.string() + ": expected the folder of a batch with its batch.json, found none");
  try {
    const json j = json::parse(ReadTextFile(file));
    if (j.at("schema") != kPlanSchema) throw InputError("");
    BatchPlan plan;
    plan.settings = SettingsFrom(j.at("settings"));
    plan.submitted = j.at("submitted").get<std::vector<std::string>>();
    plan.summary_job = j.value("summary_job", "");
    for (const json& e : j.at("entries")) {
      plan.entries.push_back({{e.at("name"), e.at("dir").get<std::string>(), e.at("arguments")},
                              e.at("error"),
                              e.at("exit_code"),
                              e.at("tasks")});
    }
    for (const json& task : j.at("tasks")) plan.tasks.push_back(TaskFrom(task));
    return plan;
  } catch (const std::exception&) {
    throw InputError(file.string() + ": expected the plan of a batch (" + kPlanSchema +
                     "), found something else; start the batch again");
  }
}

TaskRecord ReadTaskRecord(const fs::path& folder, size_t task) {
  const fs::path file = RecordFile(folder, task);
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return {};
  try {
    return json::parse(ReadTextFile(file)).get<TaskRecord>();
  } catch (const json::exception&) {
    return {};  // damaged: as if it had not begun
  }
}

std::vector<TaskRecord> BeginTaskRecords(const BatchPlan& plan, const fs::path& folder) {
  std::vector<TaskRecord> records;
  for (size_t i = 0; i < plan.tasks.size(); ++i) {
    TaskRecord record = ReadTaskRecord(folder, i);
    const std::vector<size_t>& after = plan.tasks[i].after;
    if (!record.Done() || std::any_of(after.begin(), after.end(), [&](size_t k) { return !records[k].Done(); })) {
      record.end.clear();
      WriteTaskRecord(record, folder, i);
    }
    records.push_back(std::move(record));
  }
  return records;
}

void WriteTaskRecord(const TaskRecord& record, const fs::path& folder, size_t task) {
  WriteFileAtomically(RecordFile(folder, task), DumpJson(json(record), 1) + "\n");
}

std::vector<JobResult> NeededResults(const BatchPlan& plan, const std::vector<TaskRecord>& records, size_t task) {
  std::vector<JobResult> results;
  for (const size_t need : plan.tasks[task].needs) {
    JobResult result;
    result.job = JobOf(plan.tasks[need]);
    result.end = EndNamed(records[need].end);
    results.push_back(std::move(result));
  }
  return results;
}

BatchResult ResultOfEntry(const BatchPlan& plan, const std::vector<TaskRecord>& records,
                          const std::vector<std::string>& states, size_t index) {
  const PlannedEntry& planned = plan.entries[index];
  BatchResult result;
  result.entry = planned.entry;
  if (!planned.error.empty()) {
    result.status = "failed";
    result.error = planned.error;
    result.exit_code = planned.exit_code;
    return result;
  }
  std::map<std::string, int> counts;
  for (const size_t id : planned.tasks) ++counts[states[id]];
  try {
    const Project project = Project::Open(planned.entry.dir);
    std::vector<Job> jobs;
    std::vector<JobResult> results;
    for (const size_t id : planned.tasks) {
      jobs.push_back(JobOf(plan.tasks[id]));
      results.push_back(ResultOfTask(project, plan.tasks[id], records[id]));
    }
    const RunReport report = ReportOf("run", project, jobs, results);
    result.stages = report.json["stages"];
    result.exit_code = report.exit_code;
    const bool all_ended =
        std::all_of(planned.tasks.begin(), planned.tasks.end(), [&](size_t id) { return records[id].Ended(); });
    if (all_ended && !report.problems.empty()) result.error = report.problems.front();
  } catch (const Error& e) {
    result.exit_code = e.ExitCode();
    result.error = e.what();
    result.status = "failed";
    return result;
  }
  for (size_t k = 0; k < planned.tasks.size(); ++k) {
    const size_t id = planned.tasks[k];
    result.stages[k]["status"] = states[id];
    result.stages[k]["task"] = id;
    AddCosts(records[id], &result, &result.stages[k]);
    const bool failed = states[id] == "failed" || states[id] == "killed" || states[id] == "lost";
    const std::string reason =
        records[id].attempts.empty() ? "did not begin; the folder logs may show why" : records[id].reason;
    if (failed && result.error.empty()) result.error = plan.tasks[id].title + ": " + reason;
  }
  if (counts["running"] + counts["queued"] > 0) {
    result.status = counts["running"] > 0 ? "running" : "waiting";
    result.exit_code = 0;  // not known yet
  } else if (counts["cancelled"] > 0) {
    result.status = "cancelled";
    result.exit_code = Cancelled().ExitCode();
  } else if (counts["waiting"] > 0) {
    result.status = "waiting";
    result.exit_code = 0;
  } else {
    result.status = result.exit_code == 0 ? "done" : result.exit_code == kGateExitCode ? "gate" : "failed";
  }
  return result;
}

}  // namespace trigpoint
