#include "app/pipeline/check_project.h"

#include "app/pipeline/detect_stage.h"
#include "app/pipeline/gates_stage.h"
#include "app/pipeline/stages.h"
#include "app/pipeline/survey_input.h"
#include "eval/plan/layout.h"

namespace trigpoint {

CheckSources SourcesOfProject() {
  CheckSources sources;
  sources.detector = [](const Project& project) { return DetectorOptions(project, {}); };
  sources.map = [](const Project& project) { return ResolveOptions<SurveyStageOptions>(project, "survey", {}).map; };
  sources.map_input = [](StageContext& context, const SeenTags& tags) -> MapInput {
    auto survey = ResolveOptions<SurveyStageOptions>(context.project, "survey", {});
    survey.tie_points = survey.photo_sets = survey.stations = survey.repeatability = false;
    SurveyJob job = MakeSurveyJob(context.project, {}, survey, context, &tags);
    return {std::move(job.input), std::move(job.warnings)};
  };
  sources.network = [](const Project& project) { return ResolveOptions<PlanOptions>(project, "plan", {}).network; };
  sources.limits = [](const Project& project) -> PredictedLimits {
    const auto plan = ResolveOptions<PlanOptions>(project, "plan", {});
    std::vector<std::string> ignored;
    return {LimitsFor(project, {}, &ignored).survey.max_tag_sigma_m, plan.max_tag_sigma_m, plan.max_camera_sigma_m};
  };
  return sources;
}

}  // namespace trigpoint
