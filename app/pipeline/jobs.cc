#include "app/pipeline/jobs.h"

#include <algorithm>
#include <set>

#include "app/pipeline/gates_stage.h"
#include "app/pipeline/single_job.h"
#include "app/pipeline/tags_wanted.h"
#include "datasets/project/files.h"
#include "datasets/project/forked.h"
#include "datasets/project/manifest.h"
#include "datasets/project/reference_parts.h"
namespace trigpoint {

namespace fs = std::filesystem;

namespace {

// Does `job` read the result of `earlier`?
bool Needs(const Project& project, const Job& job, const Job& earlier) {
  if (job.stage == earlier.stage) {
    return job.stage->parts && job.target.part != earlier.target.part &&
           earlier.target.part == job.stage->parts(project).front();
  }
  if (!NeedsStage(project, *job.stage, job.target, earlier.stage->name)) return false;
  if (job.stage->per_run && earlier.stage->per_run && job.target.run != earlier.target.run) return false;
  if (!earlier.stage->variants || !job.stage->variants) return true;
  StageTarget target = job.target;
  target.run = earlier.target.run;
  return TargetRead(project, *earlier.stage, job.stage->name, target).variant == earlier.target.variant;
}

// A job that runs although results it needs were not made warns whether it reads older ones.
void WarnOfEarlierResults(const Project& project, const Job& job, const std::vector<JobResult>& needed,
                          ProgressSink& progress) {
  for (const JobResult& other : needed) {
    if (other.end != JobEnd::kFailed && other.end != JobEnd::kSkipped) continue;
    const std::string name = ResultName(*other.job.stage, other.job.target);
    const auto failure = ReadFailure(project, other.job.stage->name, name);
    const bool refused = failure && failure->contains("refused");  // then nothing of that run is used
    const bool there = !refused && ReadManifest(project, other.job.stage->name, name).has_value();
    progress.Log(LogLevel::kWarning, job.Title() + ": " + other.job.Title() + " " + std::string(JobEndName(other.end)) +
                                         (there ? ", its earlier result is used" : ", it takes no part"));
  }
}

std::set<std::string> WithNeeds(const Project& project, const JobQuery& query) {
  const std::vector<std::string>& stages = query.stages;
  std::set<std::string> all;
  const std::function<void(const std::string&)> add = [&](const std::string& name) {
    if (!all.insert(name).second) return;
    const StageInfo& stage = StageNamed(name);
    for (const std::string& need : stage.needs) add(need);
    for (const std::string& variant : query.variants) {
      if (!stage.also_needs) break;
      for (const std::string& need : stage.also_needs(project, {"", variant, query.overrides})) add(need);
    }
  };
  if (stages.empty()) {
    for (const StageInfo& stage : Stages()) {
      if (!stage.only_on_request) all.insert(stage.name);
    }
  }
  for (const std::string& stage : stages) add(stage);
  return all;
}

// A variant that is in no trigpoint.yaml was made by options of the command line: who only reads its results keeps
// them.
void KeepGiven(const Project& project, Job* job) {
  const std::string& variant = job->target.variant;
  if (variant.empty() || project.variants().contains(variant)) return;
  const auto manifest = ReadManifest(project, job->stage->name, ResultName(*job->stage, job->target));
  if (!manifest || !manifest->contains("given")) return;
  nlohmann::json given = manifest->at("given");
  given.merge_patch(job->target.overrides);
  job->target.overrides = std::move(given);
}

bool Asks(const JobQuery& query, const std::string& stage) {
  return std::find(query.stages.begin(), query.stages.end(), stage) != query.stages.end();
}

// The results of a stage that a target of the query comes down to: those that the stages behind it read.
std::vector<StageTarget> WantedTargets(const Project& project, const StageInfo& stage, const StageTarget& target,
                                       const JobQuery& query, const std::set<std::string>& wanted) {
  std::vector<StageTarget> targets;
  const bool asked = Asks(query, stage.name);
  for (const StageInfo& reader : Stages()) {
    if (asked || !stage.read_as || wanted.count(reader.name) == 0 || !NeedsStage(project, reader, target, stage.name))
      continue;
    targets.push_back(TargetRead(project, stage, reader.name, target));
  }
  if (targets.empty()) targets.push_back(target);
  if (!stage.parts) return targets;
  std::vector<StageTarget> of_parts;
  for (const std::string& part : stage.parts(project)) {
    for (StageTarget& its : targets) {
      its.part = part;
      of_parts.push_back(its);
    }
  }
  return of_parts;
}

std::string WhyNotNeeded(const Project& project, const Job& job) {
  return job.stage->not_needed ? job.stage->not_needed(project, job.target) : "";
}

}  // namespace

std::string Job::Title() const {
  const std::string name = ResultName(*stage, target);
  return name.empty() || name.front() == '@' ? stage->name + name : stage->name + "/" + name;
}

uint64_t SeedOf(const Project& project, const std::vector<Job>& jobs) {
  for (const Job& job : jobs) {
    if (const auto manifest = ReadManifest(project, job.stage->name, ResultName(*job.stage, job.target)))
      return manifest->value("seed", uint64_t{1});
  }
  return 1;
}

std::set<std::string> ResultsIn(const fs::path& folder) {
  std::set<std::string> names;
  std::error_code ignored;
  for (fs::directory_iterator it(folder, ignored), end; it != end; it.increment(ignored)) {
    std::string name = it->path().filename().string();
    if (name.front() != '.') names.insert(std::move(name));
  }
  return names;
}

std::vector<std::string> KnownVariants(const Project& project) {
  std::set<std::string> variants = {""};
  for (const auto& [name, stages] : project.variants().items()) variants.insert(name);
  for (const StageInfo& stage : Stages()) {
    if (!stage.variants) continue;
    for (const std::string& name : ResultsIn(stage.per_run ? project.results() / stage.name : project.results())) {
      const size_t at = name.find('@');
      if (at == std::string::npos) continue;
      if (stage.per_run || name.substr(0, at) == stage.name) variants.insert(name.substr(at + 1));
    }
  }
  return {variants.begin(), variants.end()};
}

std::vector<Job> PlanJobs(const Project& project, const JobQuery& query) {
  std::vector<std::string> runs = query.runs;
  const std::vector<std::string> there = project.RunNames();
  for (const std::string& run : runs) {
    if (std::find(there.begin(), there.end(), run) == there.end()) project.run(run);  // throws, naming the nearest one
  }
  if (runs.empty()) runs = there;
  const std::set<std::string> wanted = WithNeeds(project, query);
  // What is for all runs (the survey) and only needed on the way wants all of them, whichever run was asked for.
  const auto for_all_runs = [&](const StageInfo& stage) {
    return std::any_of(Stages().begin(), Stages().end(), [&](const StageInfo& other) {
      return !other.per_run && !Asks(query, other.name) && !query.stages.empty() && wanted.count(other.name) > 0 &&
             NeedsStage(project, other, {"", query.variants.front(), query.overrides}, stage.name);
    });
  };
  std::vector<Job> jobs;
  for (const StageInfo& stage : Stages()) {
    if (wanted.count(stage.name) == 0) continue;
    const std::vector<std::string> variants = stage.variants ? query.variants : std::vector<std::string>{""};
    const std::vector<std::string>& its_runs = for_all_runs(stage) ? there : runs;
    const bool asked = Asks(query, stage.name);
    const std::vector<std::string> names = stage.per_run ? its_runs : std::vector<std::string>{""};
    for (const std::string& variant : variants) {
      for (const std::string& run : names) {
        if (stage.name == "detect" && !asked && !WantsTags(project, run)) continue;
        if (stage.first_on_request && !asked &&
            !ReadManifest(project, stage.name, ResultName(stage, {run, variant, {}})))
          continue;
        for (const StageTarget& target :
             WantedTargets(project, stage, {run, variant, query.overrides}, query, wanted)) {
          const bool known = std::any_of(jobs.begin(), jobs.end(), [&](const Job& job) {
            return job.stage == &stage && job.target.run == target.run && job.target.variant == target.variant &&
                   job.target.part == target.part;
          });
          if (known) continue;
          jobs.push_back({&stage, target});
          if (!asked) KeepGiven(project, &jobs.back());
        }
      }
    }
  }
  return jobs;
}

JobQuery ReviewQuery(const std::string& variant) {
  JobQuery query;
  for (const StageInfo& stage : Stages()) {
    // A decision does not ask for a first result.
    if (!stage.reviewed.empty() && !stage.first_on_request) query.stages.push_back(stage.name);
  }
  query.variants = {variant};
  return query;
}

std::string_view JobEndName(JobEnd end) {
  switch (end) {
    case JobEnd::kComputed: return "computed";
    case JobEnd::kUpToDate: return "up to date";
    case JobEnd::kNotNeeded: return "not needed";
    case JobEnd::kSkipped: return "skipped";
    case JobEnd::kFailed: return "failed";
  }
  return "";
}

std::vector<JobNeeds> NeedsOf(const Project& project, const std::vector<Job>& jobs) {
  std::vector<JobNeeds> all(jobs.size());
  for (size_t i = 0; i < jobs.size(); ++i) {
    // Gates and report read whatever results there are, so they come after all other jobs.
    const bool last = jobs[i].stage->name == "gates" || jobs[i].stage->name == "report";
    for (size_t k = 0; k < i; ++k) {
      const bool needs = Needs(project, jobs[i], jobs[k]);
      if (needs) all[i].needs.push_back(k);
      // Photo sets come first: localize reads their rigs.
      if (needs || last || jobs[k].stage->name == "stitch") all[i].after.push_back(k);
    }
  }
  return all;
}

std::optional<JobResult> EndWithoutRunning(const Project& project, const Job& job,
                                           const std::vector<JobResult>& needed) {
  JobResult result;
  result.job = job;
  size_t broken = 0;
  for (const JobResult& earlier : needed) {
    if (earlier.end != JobEnd::kFailed && earlier.end != JobEnd::kSkipped) continue;
    ++broken;
    result.reason = earlier.job.Title() + " " + std::string(JobEndName(earlier.end));
  }
  if (std::string why = WhyNotNeeded(project, job); !why.empty()) {
    result.end = JobEnd::kNotNeeded;
    result.reason = std::move(why);
    return result;
  }
  if (broken > 0 && (job.stage->per_run || broken == needed.size())) {
    result.end = JobEnd::kSkipped;
    return result;
  }
  return std::nullopt;
}

JobAttempt RunJob(const Project& project, const Job& job, int threads, uint64_t seed, ProgressSink& progress,
                  const CancelToken& cancel, const StageRunner& run) {
  JobAttempt attempt;
  JobResult& result = attempt.result;
  result.job = job;
  try {
    result.outcome = run(project, MakeRequest(project, *job.stage, job.target), threads, seed, progress, cancel);
    result.end = result.outcome.computed ? JobEnd::kComputed : JobEnd::kUpToDate;
  } catch (const Cancelled&) {
    throw;
  } catch (const Error& e) {
    result.end = JobEnd::kFailed;
    result.reason = e.what();
    result.exit_code = e.ExitCode();
    attempt.out_of_memory = dynamic_cast<const MemoryError*>(&e) != nullptr;
  }
  return attempt;
}

std::vector<JobResult> RunJobs(const Project& project, const std::vector<Job>& asked, int threads, uint64_t seed,
                               ProgressSink& progress, const CancelToken& cancel, const JobCallbacks& callbacks) {
  const std::shared_ptr<ProjectLock> lock = project.Lock();  // over all of them, so that nobody comes in between
  const std::vector<Job> jobs = WithGates(project, asked);
  const std::vector<JobNeeds> needs = NeedsOf(project, jobs);
  std::vector<JobResult> results;
  for (size_t i = 0; i < jobs.size(); ++i) {
    cancel.ThrowIfCancelled();
    std::vector<JobResult> needed;
    for (const size_t k : needs[i].needs) needed.push_back(results[k]);
    if (auto decided = EndWithoutRunning(project, jobs[i], needed)) {
      results.push_back(std::move(*decided));
    } else {
      callbacks.begun(jobs[i]);
      WarnOfEarlierResults(project, jobs[i], needed, progress);
      results.push_back(RunJob(project, jobs[i], threads, seed, progress, cancel, RunStage).result);
    }
    callbacks.ended(results.back());
  }
  if (std::any_of(jobs.begin(), jobs.end(), [](const Job& job) { return job.stage->name == "references"; }))
    RemoveFormerParts(project, progress);
  return results;
}

std::vector<JobState> StatesOf(const Project& project, const std::vector<Job>& jobs, uint64_t seed) {
  std::vector<JobState> states;
  for (Job job : jobs) {
    KeepGiven(project, &job);
    JobState state;
    state.job = job;
    state.reason = WhyNotNeeded(project, job);
    state.needed = state.reason.empty();
    const std::string name = ResultName(*job.stage, job.target);
    if (const auto manifest = ReadManifest(project, job.stage->name, name)) state.manifest = *manifest;
    if (const std::string damage = ManifestDamage(project, job.stage->name, name); state.needed && !damage.empty()) {
      state.reason =
          "its manifest.json is not what was written: " + damage + "; `trigpoint run` computes the result again";
    }
    if (state.needed && project.site().broken_runs.count(job.target.run) > 0) {
      state.state = StageState::kFailed;
      state.reason = project.site().broken_runs.at(job.target.run);
    } else if (state.needed) {
      StageRequest request = MakeRequest(project, *job.stage, job.target);
      uint64_t its_seed = seed;
      const std::string& variant = job.target.variant;
      const bool by_hand = !variant.empty() && !project.variants().contains(variant);
      if (by_hand && state.manifest.is_object()) {
        request.options = state.manifest.value("options", request.options);
        its_seed = state.manifest.value("seed", seed);
      }
      state.state = StateOf(project, request, its_seed);
      const auto failure = ReadFailure(project, job.stage->name, name);
      if (state.state == StageState::kFailed && failure) state.reason = failure->value("error", "");
      if (by_hand && state.state == StageState::kMissing) {  // `run` would not make it
        state.needed = false;
        state.reason = "trigpoint.yaml has no variant '" + variant + "'";
      }
      if (state.state == StageState::kDone) {
        for (const JobState& earlier : states) {
          // What is made on request only, or a variant that was never made, is no reason: this one was made without it.
          const bool optional =
              earlier.job.stage->first_on_request || (!job.stage->variants && !earlier.job.target.variant.empty());
          if (earlier.state == StageState::kMissing && optional) continue;
          if (earlier.needed && Needs(project, job, earlier.job) && earlier.state != StageState::kDone) {
            state.state = StageState::kOutOfDate;
            state.reason = earlier.job.Title() + " is " + std::string(StageStateName(earlier.state));
          }
        }
      }
    }
    states.push_back(std::move(state));
  }
  return states;
}

}  // namespace trigpoint
