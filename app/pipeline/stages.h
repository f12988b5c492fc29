// What Trigpoint can do with a project: one entry per capability, the same for command line, desktop and batch.
//
// A new stage is one file, app/pipeline/<stage>_stage.cc, and one line in stages.cc; docs/adding_a_stage.md walks
// through it. It takes its options by ResolveOptions, names every input, and its body reads them, calls the capability
// (a plain function of survey, localize or eval), and writes its artefacts below context.out:
//
//   StageInfo DetectStage() {
//     StageInfo info;
//     info.name = "detect";
//     info.help = "find the tags in every image";
//     info.metric = "detections";
//     UseOptions<TagDetectorOptions>(info);
//     info.make = [](const Project& project, const StageTarget& target) {
//       const auto options = ResolveOptions<TagDetectorOptions>(project, "detect", target);
//       StageRequest request;
//       request.version = 1;
//       request.options = JsonFromOptions(options);
//       request.inputs = RunInputs(project, project.run(target.run));
//       request.body = [options, name = target.run](StageContext& context) { ... };
//       return request;
//     };
//     return info;
//   }
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "datasets/project/options_json.h"
#include "datasets/project/stage.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// For what a stage is asked.
struct StageTarget {
  std::string run;                                      // empty: a stage with one result for all runs
  std::string variant;                                  // empty: the first set of results
  nlohmann::json overrides = nlohmann::json::object();  // {stage: {option: value}} of the command line
  std::string part = {};                                // of a stage that works in parts; empty: it has one
};

struct StageInfo {
  std::string name;
  std::string command;             // what a person types, where that is not the name
  std::string help;                // one line, begins in lower case
  bool per_run = true;             // one result per run, else one for all
  bool variants = false;           // can have a set of results per variant
  bool only_on_request = false;    // left out of `run` and `status`
  bool first_on_request = false;   // made only by its own command at first; what is there is kept up to date
  std::vector<std::string> needs;  // stages whose results it reads
  // The parts that it works in, each with a result of its own; each but the first reads that of the first. Absent: one.
  std::function<std::vector<std::string>(const Project&)> parts;
  // Further ones that a target's options ask for. Optional.
  std::function<std::vector<std::string>(const Project&, const StageTarget&)> also_needs;
  // Kinds of objects of the review (datasets/project/review.h) whose state its results rest on: "image", "detection",
  // "tag", "station", "panorama", "control". The body leaves out what project.review() excludes.
  std::vector<std::string> reviewed;
  std::string metric;              // the metric `status` shows, a key of the manifest's metrics
  std::vector<std::string> flags;  // options with a flag of their own on the command line: "mode" is --mode
  std::function<std::vector<OptionDescription>(const std::string& prefix)> options;
  // Checks a map of option values without using them: problems are added, `where` begins each.
  std::function<void(const nlohmann::json& values, const std::string& where, std::vector<std::string>& problems)> check;
  // The request; `stage` and `name` are filled in by MakeRequest. Throws OptionError, InputError.
  std::function<StageRequest(const Project&, const StageTarget&)> make;
  // What a person reads on the command line when the result is there: tables, where things lie. Optional.
  std::function<std::string(const StageOutcome&, const DisplayUnit&)> summary;
  // Of a stage with variants: the target whose result `reader`, a stage that needs it, reads for its own target.
  // Absent: the same variant's.
  std::function<StageTarget(const Project&, const std::string& reader, const StageTarget&)> read_as;
  // Why there is nothing to do for a target ("no stations.csv"), empty if there is. Optional.
  std::function<std::string(const Project&, const StageTarget&)> not_needed;
};

inline const std::string& CommandOf(const StageInfo& stage) {
  return stage.command.empty() ? stage.name : stage.command;
}

// Does a stage read results of another one for this target?
bool NeedsStage(const Project& project, const StageInfo& stage, const StageTarget& target, const std::string& other);

// The target whose result of `stage` the stage `reader` reads for `target`.
StageTarget TargetRead(const Project& project, const StageInfo& stage, const std::string& reader,
                       const StageTarget& target);

// All stages that are built, each after those it needs.
const std::vector<StageInfo>& Stages();
// Throws OptionError naming the nearest one.
const StageInfo& StageNamed(const std::string& name);

// The request of one stage for one target, with stage and name in place.
StageRequest MakeRequest(const Project& project, const StageInfo& stage, const StageTarget& target);
// results/<stage>/<name>: run, run@variant, "", @variant or @part.
std::string ResultName(const StageInfo& stage, const StageTarget& target);
// The manifest of the result of another stage for the same target, as an input.
std::filesystem::path ManifestOf(const Project& project, const std::string& stage, const StageTarget& target);
// Its folder, to read artefacts from.
std::filesystem::path ResultOf(const Project& project, const std::string& stage, const StageTarget& target);

// Every file a run consists of: images or video, calibration, masks, odometry, GPS, run.yaml.
std::vector<std::filesystem::path> RunInputs(const Project& project, const Run& run);
// A reference's pictures and masks.
std::vector<std::filesystem::path> FilesOfReference(const Reference& reference);
// Every file the references of a site, all of the project's or some, consist of: pictures and masks, and the tables.
std::vector<std::filesystem::path> ReferenceInputs(const Project& project, const Site& site, bool tables = true);

// Throws OptionError naming every stage and option of trigpoint.yaml that is unknown, of the wrong type or out of
// range.
void CheckProjectOptions(const Project& project);

// The values a target's options are made of, later ones first laid over: trigpoint.yaml's stages, the variant's, the
// command line's; each with where it stands.
struct OptionLayer {
  nlohmann::json values;
  std::string where;
};
// The variant "paper" needs no entry in trigpoint.yaml: a stage that has an option `mode` gets mode: paper by it.
std::vector<OptionLayer> OptionLayers(const Project& project, const std::string& stage, const StageTarget& target);

// {stage: {option: value}} with the options that once were another stage's in their places: those of `reconstruct` were
// localize's, and project files that set them there are read.
nlohmann::json MovedOptions(nlohmann::json stages);
// The groups of options that moved: "tracks", ...
const std::vector<std::string>& ReconstructionOptionGroups();

// `options`, by default the defaults, with the target's layers over them. Options with modes (a static ForMode(name))
// begin with the defaults of the mode that the layers name. Throws OptionError listing everything that is wrong.
template <typename Options>
Options ResolveOptions(const Project& project, const std::string& stage, const StageTarget& target,
                       Options options = {}) {
  if constexpr (requires { Options::ForMode(std::string()); }) {
    for (const OptionLayer& layer : OptionLayers(project, stage, target)) {
      const auto mode = layer.values.find("mode");
      if (mode != layer.values.end() && mode->is_string())
        options = Options::ForMode(mode->template get<std::string>());
    }
  }
  std::vector<std::string> problems;
  for (const OptionLayer& layer : OptionLayers(project, stage, target)) {
    SetOptions(layer.values, layer.where, options, problems);
  }
  if (problems.empty()) {
    for (const std::string& problem : options.Check()) problems.push_back("stage " + stage + ": " + problem);
  }
  ThrowIfAny(problems);
  return options;
}

// Fills in `options` and `check` of a stage's entry.
template <typename Options>
void UseOptions(StageInfo& info) {
  info.options = [](const std::string& prefix) { return DescribeOptions<Options>(prefix); };
  info.check = [](const nlohmann::json& values, const std::string& where, std::vector<std::string>& problems) {
    Options options;
    const size_t before = problems.size();
    SetOptions(values, where, options, problems);
    if (problems.size() > before) return;
    for (const std::string& problem : options.Check()) problems.push_back(where + ": " + problem);
  };
}

}  // namespace trigpoint
