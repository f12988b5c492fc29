#include "app/pipeline/plan_stage.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "app/pipeline/survey_input.h"
#include "datasets/io/text.h"
#include "eval/plan/page.h"
#include "eval/report/drawing_memory.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// What the site's survey runs give.
SurveyInput SurveyedInput(StageContext& context) {
  const Project& project = context.project;
  if (SurveyRuns(project).empty() || !project.site().tags.Given()) {
    throw InputError(project.dir().string() +
                     ": nothing to plan with; expected plan.csv or plan.geojson (docs/file_formats.md), or a site with "
                     "tags (tags.yaml) and survey runs in which they are detected");
  }
  SurveyStageOptions survey;
  survey.tie_points = survey.photo_sets = survey.stations = survey.repeatability = false;
  SurveyJob job = MakeSurveyJob(project, {}, survey, context);
  for (const std::string& warning : job.warnings) context.progress.Log(LogLevel::kWarning, warning);
  if (!job.input.runs.empty()) return std::move(job.input);
  throw InputError(project.dir().string() +
                   ": no run has detections; run `trigpoint detect` first, or sketch the site "
                   "in plan.csv");
}

PlanLayout MakeLayout(const PlanOptions& options, StageContext& context) {
  const Project& project = context.project;
  const fs::path file = SketchFile(project, options);
  const std::vector<SketchItem> items = file.empty() ? std::vector<SketchItem>() : ReadSiteSketch(file);
  PlanLayout layout;
  if (file.empty() || AddsToSurvey(items, !SurveyRuns(project).empty())) {
    layout = LayoutOfSurvey(project, SurveyedInput(context), options.network, file, context);
  }
  if (file.empty()) return layout;
  return LayoutOfSketch(project, file, items, options, std::move(layout));
}

// The files it reads.
std::vector<fs::path> PlanInputs(const Project& project, const PlanOptions& options) {
  std::vector<fs::path> inputs;
  const fs::path file = SketchFile(project, options);
  for (const char* always : {"tags.yaml", "aerial.tif"}) {
    if (fs::exists(project.dir() / always)) inputs.push_back(project.dir() / always);
  }
  if (!file.empty()) {
    inputs.push_back(file);
    if (!options.camera.empty()) {
      const fs::path calibrated = project.results() / "calibrate" / options.camera / "camchain.yaml";
      inputs.push_back(fs::exists(calibrated) ? calibrated : project.dir() / options.camera);
    }
    try {
      if (!AddsToSurvey(ReadSiteSketch(file), !SurveyRuns(project).empty())) return inputs;
    } catch (const InputError&) {  // is said when the plan is made
      return inputs;
    }
  }
  for (const char* table : {"control_points.csv", "distances.csv", "stations.csv", "panoramas.csv"}) {
    if (fs::exists(project.dir() / table)) inputs.push_back(project.dir() / table);
  }
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its;
    its.run = run->name;
    inputs.push_back(ManifestOf(project, "detect", its));
    std::error_code ignored;
    for (fs::directory_iterator it(run->dir, ignored), end; it != end; it.increment(ignored)) {
      if (it->is_regular_file(ignored) && it->file_size() < 100'000'000) inputs.push_back(it->path());
    }
  }
  std::sort(inputs.begin(), inputs.end());
  return inputs;
}

void MakePlan(const PlanOptions& options, StageContext& context) {
  const PlanFindings findings = FindPlan(options, MakeLayout(options, context), context);
  RequireDrawingMemory("drawing the plan", kPageMemory_mib);
  WritePlan(findings, context.out);
  const nlohmann::json summary = nlohmann::json::parse(ReadTextFile(context.out / "summary.json"));
  for (const char* key : {"source", "tags", "rms_tag_sigma_m", "weakest_tag", "datum"}) {
    context.metrics[key] = summary.at(key);
  }
  if (findings.gates.empty()) return;
  const bool passed =
      std::all_of(findings.gates.begin(), findings.gates.end(), [](const PlanGate& g) { return g.passed; });
  context.metrics["gates"] = passed ? "PASS" : findings.gates.front().undecided ? "UNDECIDED" : "FAIL";
}

}  // namespace

StageInfo PlanStage() {
  StageInfo info;
  info.name = "plan";
  info.help = "predict the accuracy of a survey before the trip, and what would improve it";
  info.per_run = false;
  info.metric = "rms_tag_sigma_m";
  UseOptions<PlanOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<PlanOptions>(project, "plan", target);
    StageRequest request;
    request.version = 7;
    request.options = JsonFromOptions(options);
    request.inputs = PlanInputs(project, options);
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options](StageContext& context) { MakePlan(options, context); };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return PlanSummary(nlohmann::json::parse(ReadTextFile(outcome.dir / "summary.json")), unit);
  };
  return info;
}

}  // namespace trigpoint
