#include "app/pipeline/rerun.h"

#include <utility>

#include "app/pipeline/jobs.h"

namespace trigpoint {

using nlohmann::json;

namespace {

json OptionsOf(const json& stages, const std::string& key) {
  const json result = stages.value(key, json::object());
  return result.is_object() ? result.value("options", json::object()) : json::object();
}

// The job that makes a recorded result again; `stages`: all that the release records.
Job JobOf(const RecordedResult& recorded, const json& stages) {
  const std::string stage = recorded.record["stage"];
  Job job{&StageNamed(stage), {}};
  if (job.stage->per_run) job.target.run = recorded.run;
  (job.stage->parts ? job.target.part : job.target.variant) = recorded.at;
  json given = recorded.record["options"];
  // The mode is an option of localize, but the reconstruction's results depend on it.
  if (stage == "reconstruct" && given.contains("mode")) {
    job.target.overrides["localize"] = {{"mode", given["mode"]}};
    given.erase("mode");
  }
  job.target.overrides[stage] = std::move(given);
  // Limits given on the command line of evaluate.
  if (stage == "gates") job.target.overrides["evaluate"] = OptionsOf(stages, "evaluate");
  return job;
}

}  // namespace

RerunResult Rerun(const RerunOptions& options, int threads, ProgressSink& progress, const CancelToken& cancel) {
  const ReleaseRecord record = ReadWholeRelease(options.release, threads, cancel);
  const json& j = record.json;
  const std::vector<ReleasedInput> inputs = ReadInputs(options, record);
  std::vector<std::pair<RecordedResult, Job>> plan;
  for (const json& key : j.at("order")) {
    RecordedResult recorded = ReadRecorded(options, record, key);
    Job job = JobOf(recorded, j.at("stages"));
    plan.emplace_back(std::move(recorded), std::move(job));
  }
  const std::string name = j.value("folder", "");
  const WorkFolder work(options.out, StaysInside(name) && name.find('/') == std::string::npos ? name : "project");
  RerunResult result;
  GatherInputs(options, inputs, work.project(), progress, cancel);
  const Project project = Project::Open(work.project());
  for (const auto& [recorded, job] : plan) {
    if (job.stage->name == "calibrate") {
      result.taken.push_back(recorded.key);
      continue;
    }
    cancel.ThrowIfCancelled();
    progress.Begin(recorded.key, 0);
    const StageRequest request = MakeRequest(project, *job.stage, job.target);
    const json seed = recorded.record.value("seed", json());
    const StageOutcome outcome =
        RunStage(project, request, threads, seed.is_number_unsigned() ? seed.get<uint64_t>() : 1, progress, cancel);
    CompareResult(options, recorded, outcome.manifest, outcome.dir, &result);
    result.results.push_back(recorded.key);
  }
  CompareVersions(record, &result.notes);
  if (work.keep()) result.dir = work.project();
  return result;
}

}  // namespace trigpoint
