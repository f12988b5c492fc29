// evaluate: the localized panoramas of all runs against tags and control points.
#include <fmt/format.h>

#include "app/pipeline/jobs.h"
#include "app/pipeline/stage_list.h"
#include "datasets/io/text.h"
#include "eval/errors/evaluated_runs.h"
#include "eval/errors/evaluation_files.h"
#include "eval/errors/measured_offsets.h"
#include "eval/errors/reference_maps.h"
#include "eval/errors/rotation_errors.h"
#include "eval/evidence/rolling_tags.h"
#include "eval/gates/limits.h"
#include "eval/trajectory/score_estimates.h"
#include "eval/truth/score_truth.h"
#include "eval/truth/truth.h"
#include "survey/tags/excluded_detections.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_shape.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct EvaluateStageOptions {
  EvaluateOptions errors;
  TagPosesOptions tags;
  EvaluateLimits gates;  // judged by the stage `gates`
  EstimateScoreOptions estimates;
  std::string reference;           // empty: self, control, survey
  std::string offsets = "stated";  // of stations: stated, estimated, combined
  std::string truth;               // a folder of true poses
  bool paper_tables = false;       // the paper's own two tables beside ours
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    EvaluateOptions::Visit(self.errors, visit);
    visit(self.tags, {"tags", "", 0, 0, "tag poses from the run's own cameras"});
    EvaluateLimits::Visit(self.gates, visit);
    visit(self.estimates,
          {"estimates", "", 0, 0, "cameras and other systems' trajectories against the reference poses"});
    visit(self.reference,
          {"reference", "", 0, 0,
           "compare with this reference only: self, control, survey, survey@V or a release; empty: the first three"});
    visit(self.offsets,
          {"offsets", "", 0, 0,
           "station offsets: stated (stations.csv), estimated by the tags that panoramas show (survey), or "
           "combined"});
    visit(self.truth,
          {"truth", "", 0, 0, "a folder of true poses (runs/<run>_cameras.tum, panoramas.tum) to score against"});
    visit(self.paper_tables, {"paper_tables", "", 0, 1, "print the published tables of the paper too"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = errors.Check();
    for (const std::string& problem : tags.Check()) problems.push_back("tags: " + problem);
    for (const std::string& problem : CheckOffsets(offsets)) problems.push_back(problem);
    for (const std::string& problem : CheckRanges(gates)) problems.push_back(problem);
    return problems;
  }
};

StageTarget TargetOf(const std::string& run, const std::string& variant) {
  StageTarget target;
  target.run = run;
  target.variant = variant;
  return target;
}

// The variants whose results stand side by side: the one asked for; for the first set, all that there are.
std::vector<std::string> VariantsFor(const Project& project, const std::string& variant) {
  if (!variant.empty()) return {variant};
  std::vector<std::string> known = {""};
  for (const std::string& other : KnownVariants(project)) {
    if (!other.empty()) known.push_back(other);
  }
  return EvaluatedVariants(project, known);
}

void EvaluateProject(const EvaluateStageOptions& options, const std::string& variant, StageContext& context) {
  EvaluateInput input;
  input.stations = context.project.site().stations;
  std::erase_if(input.stations, [&](const Station& s) { return context.project.review().ExcludesStation(s.name); });
  input.references = ReferencesFor(context.project, options.reference, context.progress);
  EvaluationExtras extras;
  input.measured_stations =
      UseMeasuredOffsets(context.project, options.offsets, variant, &input.stations, &extras.notes);
  const bool own_tags = options.reference.empty() || options.reference == "self";
  const std::vector<std::string> variants = VariantsFor(context.project, variant);
  input.runs = ReadEvaluatedRuns(own_tags ? &options.tags : nullptr, variants, input.stations, context, &extras.notes);
  const EvaluatedSite site = ReadEvaluatedSites(variants, input.stations, context);
  std::vector<EvaluatedRun> with_cameras = input.runs;
  with_cameras.insert(with_cameras.end(), site.cameras.begin(), site.cameras.end());
  const std::vector<EstimateReport> estimates =
      ScoreEstimates(context.project, options.estimates, with_cameras, context.progress);
  input.runs.insert(input.runs.end(), site.answers.begin(), site.answers.end());
  if (input.runs.empty() && estimates.empty()) {
    throw InputError("no run is localized; expected at least one result of `trigpoint localize`");
  }
  context.progress.Begin("errors and their intervals", 0);
  Evaluation evaluation;
  evaluation.options = options.errors;
  if (!input.runs.empty()) evaluation = Evaluate(input, options.errors);
  FillRotationErrors(context.project, input.runs, &evaluation);
  for (const std::string& warning : evaluation.warnings) context.progress.Log(LogLevel::kWarning, warning);
  extras.comparisons = CompareWithin(evaluation);
  if (!options.truth.empty()) ScoreTruth(options.truth, with_cameras, context, &extras.notes);
  if (!estimates.empty()) {
    WriteEstimates(estimates, context.out / "estimates.csv");
    const nlohmann::json json = {
        {"schema", "trigpoint estimates 1"}, {"unit", "m"}, {"estimates", EstimatesJson(estimates)}};
    WriteFileAtomically(context.out / "estimates.json", json.dump(2) + "\n");
    for (const EstimateReport& report : estimates) {
      context.metrics["estimates"].push_back(
          {{"system", report.system}, {"run", report.run}, {"rmse_m", *report.rmse_m}});
      for (const std::string& note : report.notes) {
        context.progress.Log(LogLevel::kWarning, report.system + " on " + report.run + ": " + note);
      }
    }
  }
  const std::vector<std::string> notes = extras.notes;
  const auto in_unit = [&](const DisplayUnit& unit) {
    extras.notes = notes;
    if (!estimates.empty()) extras.notes.push_back(FormatEstimates(estimates, unit.name, unit.metres));
  };
  TableOptions tables;
  tables.paper_tables = options.paper_tables;
  in_unit(tables.unit);
  WriteEvaluation(evaluation, context.out, tables, extras);
  // The same tables for people who read other units; every other file stays in metres.
  for (const char* unit : {"ft", "us-ft"}) {
    tables.unit = DisplayUnitNamed(unit);
    in_unit(tables.unit);
    WriteFileAtomically(context.out / fmt::format("tables_{}.md", unit), FormatEvaluation(evaluation, tables, extras));
  }
  context.metrics.update(EvaluationMetrics(evaluation, variant));
  context.metrics["runs"] = input.runs.size();
}

}  // namespace

StageInfo EvaluateStage() {
  StageInfo info;
  info.name = "evaluate";
  info.help = "compare localized panoramas with tags and control points: tables of errors";
  info.per_run = false;
  info.variants = true;
  info.needs = {"localize", "site", "detect", "survey", "reference"};
  info.reviewed = {"image", "detection", "tag", "station", "control"};
  info.metric = "median_m";
  info.flags = {"reference",
                "offsets",
                "truth",
                "max-median=max_median_m",
                "max-p90=max_p90_m",
                "min-answered=min_answered",
                "paper-tables=paper_tables"};
  UseOptions<EvaluateStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<EvaluateStageOptions>(project, "evaluate", target);
    StageRequest request;
    request.version = 16;
    request.options = JsonFromOptions(options);
    for (const char* table : {"stations.csv", "tags.yaml", "control_points.csv"}) {
      request.inputs.push_back(project.dir() / table);
    }
    const std::vector<std::string> variants = VariantsFor(project, target.variant);
    for (const Run* run : EvaluatedRuns(project)) {
      for (const std::string& variant : variants) {
        const StageTarget localized = TargetOf(run->name, variant);
        request.inputs.push_back(ManifestOf(project, "localize", localized));
        const std::string name = ResultName(StageNamed("localize"), localized);
        if (ReadFailure(project, "localize", name)) request.values["failed"].push_back(name);
      }
      request.inputs.push_back(ManifestOf(project, "detect", TargetOf(run->name, target.variant)));
      request.values["runs"].push_back(run->name);
      request.values["levelled"].push_back(run->config.odometry_levelled);
    }
    for (const std::string& variant : variants) {
      const fs::path site = ManifestOf(project, "site", TargetOf("", variant));
      if (fs::exists(site)) request.inputs.push_back(site);
    }
    if (options.reference.empty() || options.reference.starts_with("survey")) {
      request.inputs.push_back(ReferenceMapFolder(project, options.reference.empty() ? "survey" : options.reference) /
                               "manifest.json");
    } else if (options.reference != "self" && options.reference != "control") {
      request.inputs.push_back(ReleaseFolder(project, options.reference));  // all of it: it must be as published
    }
    if (options.offsets != "stated")
      request.inputs.push_back(ManifestOf(project, "survey", TargetOf("", target.variant)));
    if (!options.truth.empty()) request.inputs.push_back(options.truth);
    for (const fs::path& input : EstimateInputs(project)) request.inputs.push_back(input);
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
    if (project.site().stations.empty() && EstimateInputs(project).empty()) return "no stations.csv";
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
