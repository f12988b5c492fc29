#include "app/pipeline/survey_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "app/pipeline/detect_stage.h"
#include "app/pipeline/reconstruct_stage.h"
#include "datasets/io/camchain.h"
#include "datasets/io/odometry_limits.h"
#include "datasets/io/survey_tables.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "datasets/project/reference_parts.h"
#include "eval/evidence/rolling_tags.h"
#include "localize/reconstruct/image_motion.h"
#include "survey/input/control.h"
#include "survey/input/photo_sets.h"
#include "survey/input/satellites.h"
#include "survey/input/site_frame.h"
#include "survey/tags/control.h"
#include "survey/tags/excluded_detections.h"
#include "survey/tags/tie_points.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

// The scene points of a run's reconstruction, with the correction of odometry's times, and the lenses found there;
// where it cannot be read, none of them is used.
void UseReconstruction(const Project& project, const StageTarget& its, const SurveyStageOptions& options, Run* run,
                       SurveyRun* survey, std::vector<std::string>* warnings) {
  const bool points = UsesScenePoints(options, *run);
  if (!points && !UsesFoundLens(options, *run)) return;
  try {
    const fs::path dir = ReconstructionManifest(project, "survey", its).parent_path();
    const std::vector<BodyCamera> found = FoundLenses(dir);
    if (points) {
      AddTies(ReadReconstruction(project, "survey", its), options.ties_per_image, survey);
      MoveOdometry(OdometryTime(dir), run);
    }
    TakeLenses(found, &run->cameras);
  } catch (const Error& e) {
    warnings->push_back(fmt::format(
        "run {}: {}: {}", run->name,
        points ? "no scene points, tags and odometry alone" : "the lens that `trigpoint reconstruct` found is not used",
        e.what()));
  }
}

void AddRun(const Project& project, const StageTarget& target, const SurveyStageOptions& options, const Run& run,
            const DetectionsOfRuns* detections, SurveyJob* job) {
  StageTarget its = target;
  its.run = run.name;
  const fs::path file = ResultOf(project, "detect", its) / "detections.csv";
  if (detections != nullptr && !detections->contains(run.name)) return;  // the caller names those without
  if (detections == nullptr && !fs::exists(file)) {
    job->warnings.push_back("run " + run.name + " has no detections and takes no part");
    return;
  }
  SurveyRun survey;
  survey.name = run.name;
  survey.date = run.config.date;
  survey.scale_sigma = run.config.odometry_scale_sigma;
  survey.levelled = run.config.odometry_levelled && !IsFlat(run.odometry);
  Run seen = run;  // through the lenses that `reconstruct` found, with odometry's times as corrected there
  UseReconstruction(project, its, options, &seen, &survey, &job->warnings);
  survey.cameras = seen.cameras;
  survey.odometry = seen.odometry;
  survey.images = detections != nullptr ? detections->at(run.name) : ReadDetections(file, 0.5, &job->warnings);
  LeaveOutExcluded(project.review(), run.name, survey.images);
  MoveToImageTimes(seen, project.site().tags, &survey.images);
  RequireKnownLens(run.name, survey.cameras, options.map.self_calibrate);
  if (!options.map.self_calibrate) WarnOfGuessedLens(survey, &job->warnings);
  AddGps(project, run, &survey);
  job->input.runs.push_back(std::move(survey));
}

}  // namespace

std::vector<std::string> SurveyStageOptions::Check() const {
  std::vector<std::string> problems = CheckRanges(*this);
  for (const std::string& problem : DatumOptions::Check()) problems.push_back(problem);
  return problems;
}

bool UsesScenePoints(const SurveyStageOptions& options, const Run& run) {
  return options.tie_points && !options.map.self_calibrate && !run.odometry.poses.empty() && !run.images.empty();
}

bool UsesFoundLens(const SurveyStageOptions& options, const Run& run) {
  return !options.map.self_calibrate && !run.images.empty() &&
         std::any_of(run.cameras.begin(), run.cameras.end(),
                     [](const BodyCamera& c) { return c.focal_sigma_share > 0; });
}

std::map<std::string, std::string> RunsOfRefusedOdometry(const Project& project, const StageTarget& target,
                                                         const SurveyStageOptions& options) {
  std::map<std::string, std::string> refused;
  for (const Run* run : SurveyRuns(project)) {
    StageTarget its = target;
    its.run = run->name;
    if (!options.map.check_conventions) break;
    if (const auto why = WhyOdometryIsRefused(project, "survey", its)) refused[run->name] = *why;
  }
  return refused;
}

SurveyJob MakeSurveyJob(const Project& project, const StageTarget& target, const SurveyStageOptions& options,
                        StageContext& context, const DetectionsOfRuns* detections) {
  SurveyJob job;
  job.input.sizes = project.site().tags;
  // Detections of the caller's: it has looked at odometry itself.
  const auto refused =
      detections == nullptr ? RunsOfRefusedOdometry(project, target, options) : std::map<std::string, std::string>();
  for (const auto& [run, why] : refused) {
    job.warnings.push_back("run " + run + " takes no part, as `trigpoint reconstruct` refused its odometry: " + why);
  }
  for (const Run* run : SurveyRuns(project)) {
    if (!refused.contains(run->name)) AddRun(project, target, options, *run, detections, &job);
  }
  if (job.input.runs.empty() && !refused.empty()) throw InputError("no run is left: " + job.warnings.front());
  if (options.photo_sets) AddPhotoSets(project, StitchedRigs(project), DetectorOptions(project, target), context, &job);
  if (job.input.runs.empty()) throw InputError("no run has detections: run `trigpoint detect` first");
  AddDistances(project, &job);
  SetDatum(project, options, context.cancel, &job);
  if (options.map.check_conventions) RequireOneSite(project, &job);
  return job;
}

}  // namespace trigpoint
