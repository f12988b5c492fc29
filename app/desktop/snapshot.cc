#include "app/desktop/snapshot.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <tuple>

#include "app/pipeline/command_line.h"
#include "app/pipeline/stages.h"
#include "app/pipeline/stitch_stage.h"
#include "datasets/io/csv.h"
#include "datasets/project/kept.h"
#include "eval/errors/evaluate.h"

namespace trigpoint {

namespace {

const char* KindName(ReferenceKind kind) {
  switch (kind) {
    case ReferenceKind::kPanorama: return "panorama";
    case ReferenceKind::kPhoto: return "photo";
    case ReferenceKind::kPhotoSet: return "photo set";
  }
  return "";
}

StageMetric Metric(const StageInfo& stage, const nlohmann::json& manifest) {
  using Kind = StageMetric::Kind;
  if (!manifest.is_object() || stage.metric.empty()) return {};
  const nlohmann::json metrics = manifest.value("metrics", nlohmann::json::object());
  const auto it = metrics.find(stage.metric);
  if (it == metrics.end()) return {};
  if (it->is_string()) return {Kind::kWord, it->get<std::string>(), 0, ""};  // a verdict, a page
  if (!it->is_number()) return {};
  StageMetric metric{it->is_number_integer() ? Kind::kCount : Kind::kNumber, stage.metric, it->get<double>(), ""};
  for (const auto& [suffix, kind, unit] :
       {std::tuple("_m", Kind::kLength, ""), std::tuple("_px", Kind::kNumber, "px")}) {
    if (!stage.metric.ends_with(suffix)) continue;
    metric.name = stage.metric.substr(0, stage.metric.size() - std::string_view(suffix).size());
    metric.kind = kind, metric.unit = unit;
  }
  return metric;
}

double Seconds(const nlohmann::json& manifest) {
  if (!manifest.is_object()) return 0;
  const auto it = manifest.find("wall_seconds");
  return it != manifest.end() && it->is_number() ? it->get<double>() : 0;
}

std::optional<uint64_t> Seed(const nlohmann::json& manifest) {
  if (!manifest.is_object()) return std::nullopt;
  const auto it = manifest.find("seed");
  return it != manifest.end() && it->is_number_unsigned() ? std::optional(it->get<uint64_t>()) : std::nullopt;
}

// Of the same options and decisions as `request`.
bool IsMadeOf(const std::optional<nlohmann::json>& manifest, const StageRequest& request) {
  return manifest && manifest->value("version", 0) == request.version &&
         manifest->value("options", nlohmann::json()) == request.options &&
         manifest->value("values", nlohmann::json()) == request.values;
}

// Tags that no station and no control point names, but a survey found.
void AddSurveyedTags(const Project& project, std::set<int>* tags) {
  const std::filesystem::path file = ResultOf(project, "survey", {}) / "tags.csv";
  if (!std::filesystem::exists(file)) return;
  try {
    const CsvTable table = CsvTable::Read(file, {"tag_id"});
    for (const CsvRow& row : table.rows()) tags->insert(static_cast<int>(row.Integer("tag_id")));
  } catch (const Error&) {  // a broken table is named where it is shown
  }
}

void FillSite(const Project& project, Snapshot& snapshot) {
  const Site& site = project.site();
  for (const Run& run : site.runs) {
    SnapshotRun r;
    r.name = run.name, r.role = run.config.role, r.date = run.config.date, r.mirrored = run.config.mirrored;
    for (const ImageEntry& image : run.images) {
      r.images.push_back({image.file, image.path, image.stamp_ns, image.camera, image.video_frame});
    }
    for (const BodyCamera& camera : run.cameras) r.cameras.push_back(camera.name);
    snapshot.runs.push_back(std::move(r));
  }
  for (const auto& [name, reason] : site.broken_runs) {
    SnapshotRun r;
    r.name = name, r.broken = reason;
    snapshot.runs.push_back(std::move(r));
  }
  for (const Reference& reference : site.references) {
    snapshot.references.push_back({KindName(reference.kind), reference.name, reference.station, -1, reference.files});
  }
  std::set<int> tags;
  for (const Station& station : site.stations) {
    snapshot.stations.push_back({station.name, station.tag_id});
    if (station.tag_id >= 0) tags.insert(station.tag_id);
  }
  for (SnapshotReference& reference : snapshot.references) {
    // A set that is called by a number is of the station with that number, as in the evaluation.
    const std::string meant = StationNamed(reference.station, site.stations);
    for (size_t i = 0; i < snapshot.stations.size() && !meant.empty(); ++i) {
      if (snapshot.stations[i].name == meant) reference.listed = static_cast<int>(i);
    }
  }
  for (const ControlPoint& point : site.control_points) {
    const std::string name = ReviewControlName(point);
    snapshot.controls.push_back({"control:" + name, name, point.control ? "control" : "check", point.tag_id});
    if (point.tag_id >= 0) tags.insert(point.tag_id);
  }
  AddSurveyedTags(project, &tags);
  snapshot.excluded = project.review().excluded();
  snapshot.tags.assign(tags.begin(), tags.end());
}

std::vector<Job> JobsOf(const Snapshot& snapshot) {
  JobQuery query;
  query.variants = snapshot.variants;
  std::vector<Job> jobs = PlanJobs(*snapshot.project, query);
  for (Job& job : StitchJobs(*snapshot.project, {}, nlohmann::json::object())) jobs.push_back(std::move(job));
  return jobs;
}

SnapshotResult Describe(const Job& job) {
  SnapshotResult result;
  result.stage = job.stage->name;
  result.run = job.stage->per_run ? job.target.run : "";
  result.variant = job.stage->variants ? job.target.variant : "";
  result.title = job.Title();
  return result;
}

}  // namespace

std::string StageMetric::Text(const DisplayUnit& shown) const {
  switch (kind) {
    case Kind::kNone: return "";
    case Kind::kWord: return name;  // says itself what it is
    case Kind::kCount: return fmt::format("{} {:.0f}", name, value);
    case Kind::kLength: return fmt::format("{} {:.3f} {}", name, value / shown.metres, shown.name);
    case Kind::kNumber: break;
  }
  return fmt::format("{} {:.3f}{}{}", name, value, unit.empty() ? "" : " ", unit);
}

const SnapshotRun* Snapshot::FindRun(const std::string& run) const {
  for (const SnapshotRun& r : runs) {
    if (r.name == run) return &r;
  }
  return nullptr;
}

std::set<std::string> Snapshot::Related(const std::string& object) const {
  std::set<std::string> seeds = {object};
  if (object.starts_with("detection:")) {
    const size_t hash = object.rfind('#');
    seeds.insert("image:" + object.substr(10, hash - 10));
    seeds.insert("tag:" + object.substr(hash + 1));
  }
  if (object.starts_with("control:")) {  // 57, or its corner 57/2
    seeds.insert("tag:" + object.substr(8, object.find('/') - 8));
  }
  std::set<std::string> related = seeds;
  const auto add = [&](const std::set<std::string>& group) {
    const bool touched = std::any_of(group.begin(), group.end(), [&](const auto& o) { return seeds.count(o) > 0; });
    if (touched) related.insert(group.begin(), group.end());
  };
  for (size_t i = 0; i < stations.size(); ++i) {
    std::set<std::string> group = {"station:" + stations[i].name};
    if (stations[i].tag_id >= 0) group.insert("tag:" + std::to_string(stations[i].tag_id));
    for (const SnapshotReference& reference : references) {
      if (reference.listed != static_cast<int>(i)) continue;
      group.insert("panorama:" + reference.name);
      group.insert("station:" + reference.station);
    }
    add(group);
  }
  for (const SnapshotReference& reference : references) {  // stations that stations.csv doesn't list
    if (reference.listed < 0 && !reference.station.empty()) {
      add({"station:" + reference.station, "panorama:" + reference.name});
    }
  }
  for (const SnapshotControl& control : controls) {
    if (control.tag_id >= 0 && related.count("tag:" + std::to_string(control.tag_id)) > 0)
      related.insert(control.object);
  }
  return related;
}

std::shared_ptr<const Snapshot> OpenSnapshot(const std::filesystem::path& dir) {
  const auto snapshot = std::make_shared<Snapshot>();
  const auto project = std::make_shared<Project>(Project::OpenTolerant(dir, &snapshot->problems));
  snapshot->project = project;
  snapshot->dir = project->dir();
  snapshot->name = project->name();
  snapshot->warnings = project->warnings();
  FillSite(*project, *snapshot);
  try {
    CheckProjectOptions(*project);
  } catch (const Error& e) {
    snapshot->problems.emplace_back(e.what());
  }
  snapshot->variants = KnownVariants(*project);
  return snapshot;
}

std::vector<SnapshotResult> StatesOfSnapshot(const Snapshot& snapshot) {
  std::vector<SnapshotResult> results;
  for (const JobState& state : StatesOf(*snapshot.project, JobsOf(snapshot), 1)) {
    SnapshotResult result = Describe(state.job);
    result.state = state.needed ? std::string(StageStateName(state.state)) : "not needed";
    result.reason = state.reason;
    result.metric = Metric(*state.job.stage, state.manifest);
    result.seconds = Seconds(state.manifest);
    result.seed = Seed(state.manifest);
    results.push_back(std::move(result));
  }
  return results;
}

std::vector<SnapshotResult> ResultsOfSnapshot(const Snapshot& snapshot) {
  std::vector<SnapshotResult> results;
  for (const Job& job : JobsOf(snapshot)) {
    SnapshotResult result = Describe(job);
    const std::string name = ResultName(*job.stage, job.target);
    if (const auto manifest = ReadManifest(*snapshot.project, job.stage->name, name)) {
      result.metric = Metric(*job.stage, *manifest);
      result.seconds = Seconds(*manifest);
      result.seed = Seed(*manifest);
    } else if (const auto failure = ReadFailure(*snapshot.project, job.stage->name, name)) {
      result.state = "failed";
      result.reason = failure->value("error", "");
    } else {
      result.state = "missing";
    }
    results.push_back(std::move(result));
  }
  return results;
}

ExpectedTime ExpectedTimeOf(const Snapshot& snapshot, const std::vector<SnapshotResult>& results, const JobQuery& query,
                            uint64_t seed) {
  ExpectedTime expected;
  for (const Job& job : AskedJobs(*snapshot.project, query)) {
    const std::string title = job.Title();
    const auto result = std::find_if(results.begin(), results.end(), [&](const auto& r) { return r.title == title; });
    const bool other_seed = result != results.end() && result->seed && *result->seed != seed;
    const bool changed = query.overrides.contains(job.stage->name) || other_seed;
    if (result == results.end() || result->state == "missing" || result->state == "failed") {
      ++expected.never_made;
    } else if (changed || result->state == "out of date") {
      ++expected.again;
      expected.seconds += result->seconds;
      expected.of_job[title] = result->seconds;
    } else if (result->state.empty()) {
      ++expected.unchecked;
      expected.unchecked_s += result->seconds;
    }
  }
  return expected;
}

bool AreKept(const Snapshot& snapshot, const JobQuery& query) {
  const Project& project = *snapshot.project;
  try {
    const std::vector<Job> jobs = AskedJobs(project, query);
    return std::all_of(jobs.begin(), jobs.end(), [&](const Job& job) {
      if (job.stage->not_needed && !job.stage->not_needed(project, job.target).empty()) return true;
      const StageRequest request = MakeRequest(project, *job.stage, job.target);
      return IsMadeOf(ReadManifest(project, request.stage, request.name), request) ||
             IsMadeOf(ReadKept(project, request.stage, request.name), request);
    });
  } catch (const Error&) {  // wrong options: that is said when it is run
    return false;
  }
}

}  // namespace trigpoint
