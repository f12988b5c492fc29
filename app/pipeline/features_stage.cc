#include <algorithm>

#include "app/pipeline/drawn_views.h"
#include "app/pipeline/stage_list.h"
#include "datasets/project/reference_parts.h"
#include "localize/reconstruct/feature_store.h"
#include "localize/references/reference_options.h"
#include "localize/references/view_index.h"

namespace trigpoint {
namespace {

constexpr int kVersion = 5, kReferencesVersion = 5;
constexpr int kSameFeatures = 5, kSameReferences = 5;  // versions since these find the same features

nlohmann::json Metrics(const ExtractionReport& report) {
  return {{"pictures", report.pictures}, {"features", report.features}, {"skipped", report.skipped}};
}

// The result that is replaced, if it is whole and has the features that would be found now, as versions from `since` on
// have them.
FeaturesBefore Before(const Project& project, const char* stage, const std::string& name, int since) {
  FeaturesBefore before;
  before.hash_of = [&project](const std::filesystem::path& file) {
    try {
      return project.hashes().Of(file);
    } catch (const IoError&) {  // whoever reads the picture says so
      return std::string("unreadable");
    }
  };
  const auto manifest = ReadManifest(project, stage, name);
  if (!manifest || manifest->value("version", 0) < since) return before;
  const std::filesystem::path dir = project.ResultDir(stage, name);
  const nlohmann::json files = manifest->value("files", nlohmann::json::object());
  for (const char* file : {kFeaturesFile, kPicturesFile}) {
    std::error_code ignored;
    if (!std::filesystem::exists(dir / file, ignored)) return before;
    if (files.value(file, "") != project.hashes().Of(dir / file)) return before;
  }
  before.dir = dir;
  return before;
}

}  // namespace

// One database a run; the site's references have their own, shared by all runs.
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
      context.metrics.update(Metrics(ExtractRunFeatures(
          context.project.run(name), options.images, Before(context.project, "features", name, kSameFeatures),
          context.out, context.threads, context.progress, context.cancel)));
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

namespace {

// What the features of references depend on besides their pictures, where not the whole tables count.
nlohmann::json TableOf(const Site& site) {
  nlohmann::json table = nlohmann::json::array();
  for (const Reference& r : site.references) {
    nlohmann::json row = {r.name, r.mask.empty() ? "" : r.mask.lexically_relative(site.dir).generic_string()};
    if (r.camera)
      row.push_back({CameraModelName(r.camera->model()), r.camera->width(), r.camera->height(), r.camera->params()});
    table.push_back(std::move(row));
  }
  return table;
}

bool AllPanoramas(const Site& site) {
  return std::all_of(site.references.begin(), site.references.end(),
                     [](const Reference& r) { return r.kind == ReferenceKind::kPanorama; });
}

// Features of the same part, or of the one that it was cut from.
FeaturesBefore BeforePart(const Project& project, const StageInfo& stage, StageTarget target) {
  FeaturesBefore before;
  for (std::string last = "-"; before.dir.empty() && target.part != last; target.part = ParentPart(last)) {
    last = target.part;
    before = Before(project, "references", ResultName(stage, target), kSameReferences);
  }
  return before;
}

void FindReferenceFeatures(const ReferenceOptions& options, const Site& site, const FeaturesBefore& before,
                           const std::filesystem::path& first, StageContext& context) {
  context.metrics.update(Metrics(
      ExtractReferenceFeatures(site, options, before, context.out, context.threads, context.progress, context.cancel)));
  const bool in_parts = ReferenceParts(context.project.site()).size() > 1;
  if (first.empty())
    WriteCodebook(context.out, options.codebook, in_parts, context.seed, context.threads, context.cancel);
  WriteWords(context.out, first.empty() ? context.out : first, context.threads, context.cancel);
}

}  // namespace

ViewOptions ViewOptionsOf(const Project& project) {
  StageTarget first, as_made;
  first.part = ReferenceParts(project.site()).front();
  const auto manifest = ReadManifest(project, "references", ResultName(StageNamed("references"), first));
  if (manifest && manifest->contains("options") && (*manifest)["options"].contains("views"))
    as_made.overrides["references"]["views"] = (*manifest)["options"]["views"];
  return ResolveOptions<ReferenceOptions>(project, "references", as_made).views;
}

StageInfo ReferencesStage() {
  StageInfo info;
  info.name = "references";
  info.help = "find local features and visual words in the views of panoramas and in reference photos";
  info.per_run = false;
  info.parts = [](const Project& project) { return ReferenceParts(project.site()); };
  info.metric = "features";
  UseOptions<ReferenceOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<ReferenceOptions>(project, "references", target);
    const std::vector<std::string> parts = ReferenceParts(project.site());
    StageRequest request;
    request.version = kReferencesVersion;
    request.options = JsonFromOptions(options);
    Site site = SiteOfPart(project.site(), target.part);
    request.inputs = ReferenceInputs(project, site, parts.size() == 1);
    if (parts.size() > 1) request.values["references"] = TableOf(site);
    if (!AllPanoramas(site)) request.values["finest_focal_px"] = FinestFocal(site);  // photos are reduced by it
    std::filesystem::path first;
    if (target.part != parts.front()) {
      first = ReferenceResults(project).front();
      request.inputs.push_back(first / kCodebookFile);
    }
    request.body = [=, site = std::move(site)](StageContext& context) {
      FindReferenceFeatures(options, site, BeforePart(context.project, StageNamed("references"), target), first,
                            context);
    };
    return request;
  };
  return info;
}

}  // namespace trigpoint
