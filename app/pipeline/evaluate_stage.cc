// evaluate: the localized panoramas of all runs against tags and control points.
#include <fmt/format.h>

#include <map>

#include "app/pipeline/stage_list.h"
#include "datasets/io/text.h"
#include "eval/evaluation_files.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct EvaluateStageOptions {
  EvaluateOptions errors;
  TagPosesOptions tags;
  std::string reference;      // empty: all there are
  bool paper_tables = false;  // the paper's own two tables beside ours
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    EvaluateOptions::Visit(self.errors, visit);
    visit(self.tags, {"tags", "", 0, 0, "tag poses from the run's own cameras"});
    visit(self.reference, {"reference", "", 0, 0, "only against this: self, control; empty: all there are"});
    visit(self.paper_tables, {"paper_tables", "", 0, 1, "print the published tables of the paper too"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = errors.Check();
    for (const std::string& problem : tags.Check()) problems.push_back("tags: " + problem);
    return problems;
  }
};

// Runs whose results are held against something.
std::vector<const Run*> EvaluatedRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "survey") runs.push_back(&run);
  }
  return runs;
}

StageTarget TargetOf(const std::string& run, const std::string& variant) {
  StageTarget target;
  target.run = run;
  target.variant = variant;
  return target;
}

// The run's pictures with tags, with the poses that `localize` found for them in the run's own frame.
std::vector<TagView> TagViews(const Run& run, const LocalizeResult& result,
                              const std::vector<ImageDetections>& images) {
  std::vector<TagView> views;
  if (run.cameras.empty()) return views;
  std::map<int64_t, Rigid3d> odom_from_first;
  for (const TimedPose& pose : result.cameras_odom) odom_from_first[pose.stamp_ns] = pose.target_from_body;
  const Rigid3d first_from_body = run.cameras.front().cam_from_body;
  for (const ImageDetections& image : images) {
    const auto pose = odom_from_first.find(image.stamp_ns);
    if (image.detections.empty() || pose == odom_from_first.end()) continue;
    for (const BodyCamera& camera : run.cameras) {
      if (camera.name != image.camera) continue;
      TagView view;
      view.camera = &camera.camera;
      view.world_from_cam = pose->second * first_from_body * camera.cam_from_body.Inverse();
      view.run = run.name;
      view.detections = image.detections;
      views.push_back(std::move(view));
    }
  }
  return views;
}

TagResult ToTagResult(const TagEstimate& tag) {
  TagResult result;
  result.tag_id = tag.tag_id;
  result.family = tag.family;
  result.size_m = tag.size_m;
  result.map_from_tag = tag.world_from_tag;
  if (tag.HasPose()) {
    result.sigma_m = tag.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
    result.covariance = tag.covariance;
  }
  result.images = tag.images;
  result.runs = tag.runs;
  result.rms_px = tag.rms_px;
  result.role = tag.role;
  result.status = tag.status;
  return result;
}

// Surveyed tags as a map. A point says nothing about how its tag is turned, so that only stations whose offset is east,
// north, up can be held against it.
ReferenceMap ControlMap(const Project& project) {
  ReferenceMap map;
  map.name = "control";
  for (const ControlPoint& point : project.site().control_points) {
    if (point.tag_id < 0 || point.corner >= 0 || !(point.local_m || (point.geodetic && project.has_frame()))) continue;
    bool turned = false;
    for (const Station& station : project.site().stations)
      turned |= station.tag_id == point.tag_id && station.in_tag_frame;
    if (turned) continue;
    TagResult tag;
    tag.tag_id = point.tag_id;
    tag.map_from_tag = Rigid3d{Eigen::Quaterniond::Identity(),
                               point.local_m ? *point.local_m : project.frame().EnuFromGeodetic(*point.geodetic)};
    tag.sigma_m = Eigen::Vector3d(point.sigma_h_m, point.sigma_h_m, point.sigma_v_m);
    tag.role = point.control ? "control" : "check";
    tag.status = "ok";
    map.evidence.push_back("control:" + std::to_string(point.tag_id));
    map.tags.push_back(std::move(tag));
  }
  return map;
}

// What the global fit of a result rests on, one name each.
std::vector<std::string> EvidenceOf(const Run& run, const LocalizeResult& result, const nlohmann::json& manifest) {
  const std::string source = manifest.value("metrics", nlohmann::json::object()).value("earth_source", "");
  if (source == "gps") return {"gps:" + run.name};
  std::vector<std::string> evidence;
  for (const PanoramaResult& panorama : result.panoramas) {
    if (source == "geotags" && panorama.status == "localized") evidence.push_back("geotag:" + panorama.panorama);
  }
  return evidence;
}

void EvaluateProject(const EvaluateStageOptions& options, const std::string& variant, StageContext& context) {
  const Project& project = context.project;
  EvaluateInput input;
  input.stations = project.site().stations;
  const ReferenceMap control = ControlMap(project);
  if (!control.tags.empty()) input.references.push_back(control);
  const bool self = options.reference.empty() || options.reference == "self";
  if (!options.reference.empty()) {
    std::vector<std::string> names = {"self"};
    for (const ReferenceMap& map : input.references) names.push_back(map.name);
    if (std::find(names.begin(), names.end(), options.reference) == names.end()) {
      throw InputError("there is no reference '" + options.reference + "'; nearest: '" +
                       NearestName(options.reference, names) + "'");
    }
    std::erase_if(input.references, [&](const ReferenceMap& map) { return map.name != options.reference; });
  }
  for (const Run* run : EvaluatedRuns(project)) {
    const StageTarget target = TargetOf(run->name, variant);
    const auto manifest = ReadManifest(project, "localize", ResultName(StageNamed("localize"), target));
    if (!manifest) {
      context.progress.Log(LogLevel::kWarning, "run " + run->name + " is not localized and takes no part");
      continue;
    }
    EvaluatedRun evaluated;
    evaluated.run = run->name;
    evaluated.variant = variant;
    const std::string mode = manifest->value("options", nlohmann::json::object()).value("mode", "trigpoint");
    evaluated.method = mode == "paper" ? "g2" : "single";
    evaluated.odometry_levelled = run->config.odometry_levelled;
    evaluated.result = ReadLocalizeResult(ResultOf(project, "localize", target));
    for (const std::string& warning : evaluated.result.warnings) context.progress.Log(LogLevel::kWarning, warning);
    evaluated.evidence = EvidenceOf(*run, evaluated.result, *manifest);
    const fs::path detections = ResultOf(project, "detect", target) / "detections.csv";
    if (self && fs::exists(detections)) {
      std::vector<std::string> warnings;
      const std::vector<TagView> views =
          TagViews(*run, evaluated.result, ReadDetections(detections, options.tags.extra_sigma_px, &warnings));
      const std::vector<TagEstimate> tags =
          EstimateTagPoses(views, project.site().tags, options.tags, context.threads, context.progress, context.cancel);
      WriteTags(context.out / ("tags_" + run->name + ".csv"), tags, "odom", "cameras of " + run->name);
      for (const TagEstimate& tag : tags) evaluated.self_tags.push_back(ToTagResult(tag));
    }
    input.runs.push_back(std::move(evaluated));
  }
  if (input.runs.empty()) throw InputError("no run is localized; expected at least one result of `trigpoint localize`");
  context.progress.Begin("errors and their intervals", 0);
  const Evaluation evaluation = Evaluate(input, options.errors);
  for (const std::string& warning : evaluation.warnings) context.progress.Log(LogLevel::kWarning, warning);
  TableOptions tables;
  tables.paper_tables = options.paper_tables;
  WriteEvaluation(evaluation, context.out, tables);
  // The same tables for people who read other units; every other file stays in metres.
  for (const char* unit : {"ft", "us-ft"}) {
    tables.unit = DisplayUnitNamed(unit);
    WriteFileAtomically(context.out / fmt::format("tables_{}.md", unit), FormatEvaluation(evaluation, tables));
  }
  nlohmann::json groups = nlohmann::json::array();
  for (const GroupSummary& group : evaluation.groups) {
    nlohmann::json entry = {{"method", group.group.method}, {"reference", group.group.reference},
                            {"kind", group.group.kind},     {"attempts", group.attempts},
                            {"answers", group.answers},     {"median_m", nullptr}};
    if (group.error_3d.median) entry["median_m"] = *group.error_3d.median;
    // The number a user looks for first: our own answers against the run's own tags, else the first there is.
    if (group.error_3d.median && (!context.metrics.contains("median_m") || group.group.reference == "self")) {
      if (group.group.method != "g1") context.metrics["median_m"] = *group.error_3d.median;
    }
    groups.push_back(std::move(entry));
  }
  context.metrics["groups"] = groups;
  context.metrics["runs"] = input.runs.size();
}

}  // namespace

StageInfo EvaluateStage() {
  StageInfo info;
  info.name = "evaluate";
  info.help = "compare localized panoramas with tags and control points: tables of errors";
  info.per_run = false;
  info.variants = true;
  info.needs = {"localize", "detect"};
  info.metric = "median_m";
  info.flags = {"reference"};
  UseOptions<EvaluateStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<EvaluateStageOptions>(project, "evaluate", target);
    StageRequest request;
    request.options = JsonFromOptions(options);
    for (const char* table : {"stations.csv", "tags.yaml", "control_points.csv"}) {
      request.inputs.push_back(project.dir() / table);
    }
    for (const Run* run : EvaluatedRuns(project)) {
      const StageTarget its = TargetOf(run->name, target.variant);
      request.inputs.push_back(ManifestOf(project, "localize", its));
      request.inputs.push_back(ManifestOf(project, "detect", its));
      request.values["runs"].push_back(run->name);
      request.values["levelled"].push_back(run->config.odometry_levelled);
    }
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options, variant = target.variant](StageContext& context) {
      EvaluateProject(options, variant, context);
    };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget&) -> std::string {
    if (project.site().stations.empty()) return "no stations.csv";
    if (EvaluatedRuns(project).empty()) return "no run whose role is evaluation or both";
    return "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    const fs::path tables = outcome.dir / (unit.name == "m" ? "tables.md" : "tables_" + unit.name + ".md");
    return ReadTextFile(tables) + "Tables: " + (outcome.dir / "tables.md").string() + "\n";
  };
  return info;
}

}  // namespace trigpoint
