#include "app/pipeline/stages.h"

#include <algorithm>

#include "app/pipeline/calibrate_stage.h"
#include "app/pipeline/crosscheck_stage.h"
#include "app/pipeline/gates_stage.h"
#include "app/pipeline/plan_stage.h"
#include "app/pipeline/report_stage.h"
#include "app/pipeline/stage_list.h"
#include "app/pipeline/stitch_stage.h"
#include "datasets/io/mask.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;
using nlohmann::json;

// Each is defined in the file of its name; here they stand in the order in which they need each other.
const std::vector<StageInfo>& Stages() {
  static const std::vector<StageInfo> kStages = {
      FeaturesStage(), ReconstructStage(), ReferencesStage(), DetectStage(), SurveyStage(),     LocalizeStage(),
      SiteStage(),     ReferenceStage(),   EvaluateStage(),   GatesStage(),  CrosscheckStage(), ReportStage()};
  return kStages;
}

const StageInfo& StageNamed(const std::string& name) {
  // Has one result per photo set, so that it is no part of the plan for runs.
  static const StageInfo kStitch = StitchStage();
  if (name == kStitch.name) return kStitch;
  std::vector<std::string> names = {kStitch.name};
  for (const StageInfo& stage : Stages()) {
    if (stage.name == name) return stage;
    names.push_back(stage.name);
  }
  static const StageInfo kCalibrate = CalibrateStage();  // has options, but is no part of `run`
  if (name == kCalibrate.name) return kCalibrate;
  names.push_back(kCalibrate.name);
  static const StageInfo kPlan = PlanStage();  // the same
  if (name == kPlan.name) return kPlan;
  names.push_back(kPlan.name);
  const std::string nearest = NearestName(name, names);
  throw OptionError("unknown stage '" + name + "'" + (nearest.empty() ? "" : "; nearest known one: '" + nearest + "'"));
}

std::string ResultName(const StageInfo& stage, const StageTarget& target) {
  if (stage.parts) return target.part.empty() ? "" : "@" + target.part;
  const std::string run = stage.per_run ? target.run : "";
  return stage.variants && !target.variant.empty() ? run + "@" + target.variant : run;
}

StageRequest MakeRequest(const Project& project, const StageInfo& stage, const StageTarget& target) {
  StageRequest request = stage.make(project, target);
  request.stage = stage.name;
  request.name = ResultName(stage, target);
  request.given = target.overrides;
  // Only where something is decided, so that a project without a review keeps its results.
  json review = project.review().InForce(stage.reviewed, stage.per_run ? target.run : "");
  if (!review.is_null()) request.values["review"] = std::move(review);
  return request;
}

fs::path ResultOf(const Project& project, const std::string& stage, const StageTarget& target) {
  return project.ResultDir(stage, ResultName(StageNamed(stage), target));
}

fs::path ManifestOf(const Project& project, const std::string& stage, const StageTarget& target) {
  return ResultOf(project, stage, target) / "manifest.json";
}

std::vector<fs::path> RunInputs(const Project& project, const Run& run) {
  std::vector<fs::path> inputs;
  std::error_code ignored;
  // Tables first: every small file of the run's folder, known by name or not, since readers may take new ones in.
  for (fs::directory_iterator it(run.dir, ignored), end; it != end; it.increment(ignored)) {
    if (it->is_regular_file(ignored) && it->path().filename().string().front() != '.') inputs.push_back(it->path());
  }
  for (const ImageEntry& image : run.images) inputs.push_back(image.path);
  if (!run.config.camera.empty())
    inputs.push_back(project.results() / "calibrate" / run.config.camera / "camchain.yaml");
  const std::vector<fs::path> masks = MaskFiles(run);
  inputs.insert(inputs.end(), masks.begin(), masks.end());
  std::sort(inputs.begin(), inputs.end());
  inputs.erase(std::unique(inputs.begin(), inputs.end()), inputs.end());
  return inputs;
}

std::vector<fs::path> FilesOfReference(const Reference& reference) {
  std::vector<fs::path> files = reference.files;
  if (!reference.mask.empty()) files.push_back(reference.mask);
  if (reference.kind != ReferenceKind::kPhotoSet) return files;
  for (const fs::path& photo : reference.files) {
    fs::path mask = MaskInFolder(photo.parent_path() / "masks", photo.filename().string());
    if (!mask.empty()) files.push_back(std::move(mask));
  }
  return files;
}

std::vector<fs::path> ReferenceInputs(const Project& project, const Site& site, bool tables) {
  std::vector<fs::path> inputs;
  for (const char* table : {"panoramas.csv", "photos.csv"}) {
    if (tables && fs::exists(project.dir() / table)) inputs.push_back(project.dir() / table);
  }
  for (const Reference& reference : site.references) {
    const std::vector<fs::path> files = FilesOfReference(reference);
    inputs.insert(inputs.end(), files.begin(), files.end());
  }
  return inputs;
}

bool NeedsStage(const Project& project, const StageInfo& stage, const StageTarget& target, const std::string& other) {
  std::vector<std::string> needs = stage.needs;
  if (stage.also_needs) {
    for (std::string& name : stage.also_needs(project, target)) needs.push_back(std::move(name));
  }
  return std::find(needs.begin(), needs.end(), other) != needs.end();
}

StageTarget TargetRead(const Project& project, const StageInfo& stage, const std::string& reader,
                       const StageTarget& target) {
  StageTarget read = target;
  if (!stage.variants) read.variant.clear();
  return stage.read_as ? stage.read_as(project, reader, read) : read;
}

const std::vector<std::string>& ReconstructionOptionGroups() {
  static const std::vector<std::string> kGroups = {"tracks", "pairs", "reconstruct", "loops"};
  return kGroups;
}

namespace {

// Puts the options that were another stage's behind those that the stage has itself.
void AddMoved(const std::string& stage, json moved, json* stages) {
  if (moved.empty()) return;
  if (const auto own = stages->find(stage); own != stages->end()) moved.merge_patch(*own);
  (*stages)[stage] = std::move(moved);
}

// The members of `keys` are taken out of an object.
json TakeOut(const std::vector<std::string>& keys, json* from) {
  json taken = json::object();
  if (!from->is_object()) return taken;
  for (const std::string& key : keys) {
    if (!from->contains(key)) continue;
    taken[key] = from->at(key);
    from->erase(key);
  }
  return taken;
}

}  // namespace

json MovedOptions(json stages) {
  const auto from = stages.find("localize");
  if (from == stages.end() || !from->is_object()) return stages;
  json localize = *from;
  json reconstruct = TakeOut(ReconstructionOptionGroups(), &localize);
  json references = json::object();
  if (const auto retrieval = localize.find("retrieval"); retrieval != localize.end()) {
    json codebook = TakeOut({"words", "training_descriptors", "iterations"}, &*retrieval);
    if (!codebook.empty()) references["codebook"] = std::move(codebook);
    if (retrieval->empty()) localize.erase("retrieval");
  }
  if (reconstruct.empty() && references.empty()) return stages;
  if (localize.empty()) {
    stages.erase("localize");
  } else {
    stages["localize"] = std::move(localize);
  }
  AddMoved("reconstruct", std::move(reconstruct), &stages);
  AddMoved("references", std::move(references), &stages);
  return stages;
}

std::vector<OptionLayer> OptionLayers(const Project& project, const std::string& stage, const StageTarget& target) {
  const std::string file = (project.dir() / "trigpoint.yaml").string();
  const auto of_stage = [&](const json& stages) {
    return stages.is_object() ? MovedOptions(stages).value(stage, json::object()) : json::object();
  };
  std::vector<OptionLayer> layers = {{of_stage(project.stages()), file + ": stages." + stage}};
  if (target.variant == "paper" && !project.variants().contains("paper")) {
    const std::vector<std::string>& flags = StageNamed(stage).flags;
    if (std::find(flags.begin(), flags.end(), "mode") != flags.end()) {
      layers.push_back({{{"mode", "paper"}}, "the variant paper"});
    }
  } else if (!target.variant.empty()) {
    layers.push_back({of_stage(project.variants().value(target.variant, json::object())),
                      file + ": variants." + target.variant + "." + stage});
  }
  if (const json given = of_stage(target.overrides); !given.empty()) layers.push_back({given, "command line"});
  return layers;
}

void CheckProjectOptions(const Project& project) {
  const std::string file = (project.dir() / "trigpoint.yaml").string();
  std::vector<std::string> problems;
  const auto check = [&](const json& stages, const std::string& where) {
    const json moved = MovedOptions(stages);
    for (const auto& [name, values] : moved.items()) {
      try {
        StageNamed(name).check(values, where + "." + name, problems);
      } catch (const OptionError& e) {
        problems.push_back(where + ": " + e.what());
      }
    }
  };
  check(project.stages(), file + ": stages");
  for (const auto& [variant, stages] : project.variants().items()) check(stages, file + ": variants." + variant);
  if (problems.empty()) LimitsFor(project, {}, &problems);
  ThrowIfAny(problems);
}

}  // namespace trigpoint
