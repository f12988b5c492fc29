// survey: one tag map from all runs whose role is survey.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/pipeline/detect_stage.h"
#include "app/pipeline/reconstruct_stage.h"
#include "app/pipeline/stage_list.h"
#include "app/pipeline/survey_input.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "datasets/project/reference_parts.h"
#include "eval/survey/report.h"
#include "eval/survey/summary.h"
#include "eval/survey/tables.h"
#include "survey/input/station_offsets.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

fs::path AgainstFile(const Project& project, const SurveyStageOptions& options) {
  const fs::path given = project.dir() / options.against;
  if (fs::is_regular_file(given)) return given;
  return project.ResultDir("survey", "@" + options.against) / "tags.csv";
}

std::vector<fs::path> SurveyInputs(const Project& project, const StageTarget& target,
                                   const SurveyStageOptions& options) {
  std::vector<fs::path> inputs;
  for (const char* table :
       {"tags.yaml", "control_points.csv", "control_observations.csv", "ground_control_points.json", "gcp_list.txt",
        "distances.csv", "total_station.csv", "stations.csv", "panoramas.csv", "photos.csv"}) {
    if (fs::exists(project.dir() / table)) inputs.push_back(project.dir() / table);
  }
  if (!options.against.empty()) inputs.push_back(AgainstFile(project, options));
  const auto at_station = [&](const Reference& reference) {
    const std::vector<Station>& stations = project.site().stations;
    return std::any_of(stations.begin(), stations.end(),
                       [&](const Station& station) { return station.name == reference.station; });
  };
  for (const Reference& reference : project.site().references) {
    if ((options.stations && at_station(reference)) ||
        (options.photo_sets && reference.kind == ReferenceKind::kPhotoSet)) {
      const std::vector<fs::path> files = FilesOfReference(reference);
      inputs.insert(inputs.end(), files.begin(), files.end());
    }
  }
  if (options.stations || options.photo_sets) {
    for (const auto& [set, dir] : StitchedRigs(project)) {
      if (fs::exists(dir / "manifest.json")) inputs.push_back(dir / "manifest.json");
    }
  }
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its = target;
    its.run = run->name;
    inputs.push_back(ManifestOf(project, "detect", its));
    const fs::path reconstruction = ReconstructionManifest(project, "survey", its);
    if (UsesScenePoints(options, *run) || (UsesFoundLens(options, *run) && fs::exists(reconstruction))) {
      inputs.push_back(reconstruction);
    }
    // Its tables, whatever their names; pictures are behind the stages it reads.
    std::error_code ignored;
    for (fs::directory_iterator it(run->dir, ignored), end; it != end; it.increment(ignored)) {
      if (it->is_regular_file(ignored) && it->file_size() < 100'000'000) inputs.push_back(it->path());
    }
  }
  std::sort(inputs.begin(), inputs.end());
  return inputs;
}

void Survey(const SurveyStageOptions& options, const StageTarget& target, StageContext& context) {
  const SurveyJob job = MakeSurveyJob(context.project, target, options, context);
  for (const std::string& warning : job.warnings) context.progress.Log(LogLevel::kWarning, warning);
  SurveyOptions of_map = options.map;
  of_map.budget = true;
  const SurveyResult result = SurveyTags(job.input, of_map, context.threads, context.progress, context.cancel);
  for (const MapWarning& warning : result.warnings) context.progress.Log(LogLevel::kWarning, warning.text);
  SurveyFindings findings;
  findings.frame = !result.in_world ? "map" : context.project.has_frame() && !job.local_frame ? "enu" : "local";
  const std::string& frame = findings.frame;
  findings.check_note = job.check_note;
  findings.control = job.control;
  for (const auto& [name, tags] : job.sets) findings.photo_sets.push_back(name);
  findings.nssda = options.nssda;
  if (options.repeatability) {
    findings.repeats = RepeatMap(job.input, options.map, result, context.threads, context.progress, context.cancel);
  }
  if (!options.against.empty()) {
    findings.against = options.against;
    findings.epochs = EpochsAgainst(AgainstFile(context.project, options), result);
  }
  if (options.stations && result.in_world) {
    findings.stations = MeasureStations(context.project, result.tags, job.sets, StitchedRigs(context.project),
                                        DetectorOptions(context.project, target), context);
    for (const StationOffset& o : findings.stations) {
      if (!o.offset_m || !o.Contradicts()) continue;
      context.progress.Log(
          LogLevel::kWarning,
          fmt::format("station {}: its centre is {:.3f} m from where stations.csv puts it, by the tags that {} shows, "
                      "{:.1f} sigma; measure the offset again",
                      o.station, (*o.offset_m - o.stated_m).norm(), o.panorama, std::sqrt(o.chi2)));
    }
    if (!findings.stations.empty()) WriteStationOffsets(context.out / "stations.csv", findings.stations, frame);
  }
  for (const SurveyRun& run : job.input.runs) {
    if (!run.date.empty()) findings.sessions[run.name] = run.date;
  }
  WriteSurveyTables(context.project, job, result, findings, context.out, context.progress);
  WriteTags(context.out / "tags.csv", result.tags, frame, result.datum);
  WriteTagCovariances(context.out / "tags_cov.csv", result.tags, result.cross, frame, result.datum);
  WriteFileAtomically(context.out / "summary.json", DumpJson(SurveySummary(result, findings), 2) + "\n");
  for (const char* unit : {"m", "ft", "us-ft"}) {
    WriteFileAtomically(context.out / fmt::format("report_{}.md", unit),
                        FormatSurvey(result, findings, DisplayUnitNamed(unit)));
  }
  int placed = 0;
  for (const TagEstimate& t : result.tags) placed += t.HasPose() ? 1 : 0;
  context.metrics["tags"] = placed;
  context.metrics["datum"] = result.datum;
  context.metrics["check_points"] = result.check.n;
  if (result.check.n > 0) {
    context.metrics["check_rmse_3d_m"] =
        std::hypot(result.check.rmse_3d_m, std::hypot(result.check.stated_h_m, result.check.stated_v_m));
  }
  const MapRepeats& repeats = findings.repeats;
  if (repeats.repeatability) context.metrics["repeatability_m"] = repeats.repeatability->rms_m;
  if (repeats.reproducibility) context.metrics["reproducibility_m"] = repeats.reproducibility->rms_m;
}

}  // namespace

StageInfo SurveyStage() {
  StageInfo info;
  info.name = "survey";
  info.help = "make one tag map from all runs whose role is survey";
  info.per_run = false;
  info.variants = true;
  info.reviewed = {"image", "detection", "tag", "station", "panorama", "control"};
  info.needs = {"detect"};
  info.also_needs = [](const Project& project, const StageTarget& target) -> std::vector<std::string> {
    const auto options = ResolveOptions<SurveyStageOptions>(project, "survey", target);
    for (const Run* run : SurveyRuns(project)) {
      if (UsesScenePoints(options, *run)) return {"reconstruct"};
    }
    return {};
  };
  info.metric = "tags";
  info.flags = {"datum", "against"};
  UseOptions<SurveyStageOptions>(info);
  info.check = [check = info.check](const nlohmann::json& values, const std::string& where,
                                    std::vector<std::string>& problems) {
    nlohmann::json own = values;
    for (const std::string& group : ReconstructionOptionGroups()) {
      if (!values.is_object() || own.erase(group) == 0) continue;
      problems.push_back(where + ": option '" + group +
                         "' is one of `reconstruct` now, whose points tie the survey's images; set it there");
    }
    check(own, where, problems);
  };
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<SurveyStageOptions>(project, "survey", target);
    StageRequest request;
    request.version = 23;
    request.options = JsonFromOptions(options);
    request.inputs = SurveyInputs(project, target, options);
    request.values["detector"] = JsonFromOptions(DetectorOptions(project, target));
    for (const Run* run : SurveyRuns(project)) request.values["runs"].push_back(run->name);
    const auto refused = RunsOfRefusedOdometry(project, target, options);
    if (!refused.empty()) request.values["refused_odometry"] = refused;
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options, target](StageContext& context) { Survey(options, target, context); };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget&) -> std::string {
    if (SurveyRuns(project).empty()) return "no run whose role is survey or both";
    if (!fs::exists(project.dir() / "tags.yaml")) return "no tags.yaml with the sizes of the tags";
    return "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return ReadTextFile(outcome.dir / ("report_" + unit.name + ".md")) +
           "\nMap: " + (outcome.dir / "tags.csv").string() + "\n";
  };
  return info;
}

}  // namespace trigpoint
