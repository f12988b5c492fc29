// survey: one tag map from all runs whose role is survey.
#include <fmt/format.h>

#include "app/pipeline/stage_list.h"
#include "app/pipeline/survey_report.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct SurveyStageOptions {
  SurveyOptions map;
  std::string datum = "auto";  // what may fix the map
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    SurveyOptions::Visit(self.map, visit);
    visit(self.datum, {"datum", "", 0, 0, "what fixes the map: auto (control, else geotags), control, geotags, none"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = map.Check();
    const std::vector<std::string> known = {"auto", "control", "geotags", "none"};
    if (std::find(known.begin(), known.end(), datum) == known.end()) {
      problems.push_back("option datum is '" + datum + "'; nearest known: '" + NearestName(datum, known) + "'");
    }
    return problems;
  }
};

std::vector<fs::path> SurveyInputs(const Project& project, const StageTarget& target) {
  std::vector<fs::path> inputs;
  for (const char* table : {"tags.yaml", "control_points.csv", "stations.csv", "panoramas.csv", "photos.csv"}) {
    if (fs::exists(project.dir() / table)) inputs.push_back(project.dir() / table);
  }
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its = target;
    its.run = run->name;
    inputs.push_back(ManifestOf(project, "detect", its));
    for (const char* file : {"odometry.tum", "camchain.yaml", "run.yaml"}) {
      if (fs::exists(run->dir / file)) inputs.push_back(run->dir / file);
    }
  }
  return inputs;
}

void Survey(const SurveyStageOptions& options, const StageTarget& target, StageContext& context) {
  const SurveyJob job = MakeSurveyJob(context.project, target, options.datum);
  for (const std::string& warning : job.warnings) context.progress.Log(LogLevel::kWarning, warning);
  const SurveyResult result = SurveyTags(job.input, options.map, context.threads, context.progress, context.cancel);
  for (const std::string& warning : result.warnings) context.progress.Log(LogLevel::kWarning, warning);
  const std::string frame = result.in_world ? "enu" : "map";
  WriteTags(context.out / "tags.csv", result.tags, frame, result.datum);
  WriteTagCovariances(context.out / "tags_cov.csv", result.tags, result.cross, frame, result.datum);
  WriteFileAtomically(context.out / "summary.json", DumpJson(SurveySummary(job, result), 2) + "\n");
  for (const char* unit : {"m", "ft", "us-ft"}) {
    WriteFileAtomically(context.out / fmt::format("report_{}.md", unit),
                        FormatSurvey(job, result, DisplayUnitNamed(unit)));
  }
  int placed = 0;
  for (const TagEstimate& t : result.tags) placed += t.HasPose() ? 1 : 0;
  context.metrics["tags"] = placed;
  context.metrics["datum"] = result.datum;
  context.metrics["check_points"] = result.check.n;
  if (result.check.n > 0) context.metrics["check_rmse_3d_m"] = result.check.rmse_3d_m;
}

}  // namespace

StageInfo SurveyStage() {
  StageInfo info;
  info.name = "survey";
  info.help = "make one tag map from all runs whose role is survey";
  info.per_run = false;
  info.variants = true;
  info.needs = {"detect"};
  info.reviewed = {"image", "detection", "tag", "station", "control"};
  info.metric = "tags";
  info.flags = {"datum"};
  UseOptions<SurveyStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<SurveyStageOptions>(project, "survey", target);
    StageRequest request;
    request.options = JsonFromOptions(options);
    request.inputs = SurveyInputs(project, target);
    for (const Run* run : SurveyRuns(project)) request.values["runs"].push_back(run->name);
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options, target](StageContext& context) { Survey(options, target, context); };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget&) -> std::string {
    if (SurveyRuns(project).empty()) return "no run whose role is survey or both";
    if (!fs::exists(project.dir() / "tags.yaml")) return "no tags.yaml, which says how large the tags are";
    return "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return ReadTextFile(outcome.dir / ("report_" + unit.name + ".md")) +
           "\nMap: " + (outcome.dir / "tags.csv").string() + "\n";
  };
  return info;
}

}  // namespace trigpoint
