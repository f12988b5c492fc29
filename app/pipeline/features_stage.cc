#include <algorithm>

#include "app/pipeline/stage_list.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

constexpr int kVersion = 2;

nlohmann::json Metrics(const ExtractionReport& report) {
  return {{"pictures", report.pictures}, {"features", report.features}, {"skipped", report.skipped}};
}

// The result that is replaced, if it is whole and of this version.
FeaturesBefore Before(const Project& project, const char* stage, const std::string& name) {
  FeaturesBefore before;
  before.hash_of = [&project](const std::filesystem::path& file) {
    try {
      return project.hashes().Of(file);
    } catch (const IoError&) {  // whoever reads the picture says so
      return std::string("unreadable");
    }
  };
  const auto manifest = ReadManifest(project, stage, name);
  if (!manifest || manifest->value("version", 0) != kVersion) return before;
  const std::filesystem::path dir = project.ResultDir(stage, name);
  const nlohmann::json files = manifest->value("files", nlohmann::json::object());
  for (const char* file : {"features.db", "pictures.txt"}) {
    std::error_code ignored;
    if (!std::filesystem::exists(dir / file, ignored)) return before;
    if (files.value(file, "") != project.hashes().Of(dir / file)) return before;
  }
  before.dir = dir;
  return before;
}

}  // namespace

// One database per run; the site's references have their own, shared by all runs: results/features/@references.
StageInfo FeaturesStage() {
  StageInfo info;
  info.name = "features";
  info.help = "find local features in the images of a run";
  info.metric = "features";
  UseOptions<FeatureStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<FeatureStageOptions>(project, "features", target);
    StageRequest request;
    request.version = kVersion;
    request.options = JsonFromOptions(options);
    request.inputs = RunInputs(project, project.run(target.run));
    request.body = [options, name = target.run](StageContext& context) {
      context.metrics.update(Metrics(ExtractRunFeatures(context.project.run(name), options.images,
                                                        Before(context.project, "features", name), context.out,
                                                        context.threads, context.progress, context.cancel)));
    };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget& target) -> std::string {
    if (project.site().broken_runs.count(target.run) > 0) return "";  // fails with its reason
    const Run& run = project.run(target.run);
    if (!run.images.empty()) return "";
    return run.detections.empty() ? "run " + run.name + " has no images" : "detections.csv in place of images";
  };
  return info;
}

StageInfo ReferencesStage() {
  StageInfo info;
  info.name = "references";
  info.help = "find local features in the views of panoramas and in reference photos";
  info.per_run = false;
  info.metric = "features";
  UseOptions<FeatureStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<FeatureStageOptions>(project, "references", target);
    StageRequest request;
    request.version = kVersion;
    request.options = JsonFromOptions(options);
    request.inputs = ReferenceInputs(project);
    const Site& site = project.site();
    const auto panorama = [](const Reference& r) { return r.kind == ReferenceKind::kPanorama; };
    if (!std::all_of(site.references.begin(), site.references.end(), panorama)) {
      request.values["finest_focal_px"] = FinestFocal(site);  // photos are reduced by it
    }
    request.body = [options](StageContext& context) {
      context.metrics.update(
          Metrics(ExtractReferenceFeatures(context.project.site(), options, Before(context.project, "references", ""),
                                           context.out, context.threads, context.progress, context.cancel)));
    };
    return request;
  };
  return info;
}

}  // namespace trigpoint
