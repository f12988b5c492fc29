// reconstruct: a run's images and odometry to its solution, without references and georeferencing.
#include "app/pipeline/reconstruct_stage.h"

#include <fmt/format.h>

#include "app/pipeline/stage_list.h"
#include "datasets/project/manifest.h"
#include "datasets/solution/solution_file.h"
#include "localize/files/run_reconstruction.h"
#include "localize/run_solution.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

ReconstructRunOptions OptionsFor(const Project& project, const StageTarget& target) {
  const bool paper = ModeOf(project, target) == "paper";
  return ResolveOptions(project, "reconstruct", target,
                        paper ? ReconstructRunOptions::Paper() : ReconstructRunOptions());
}

nlohmann::json IdentityOptions(const Project& project, const StageTarget& target) {
  nlohmann::json options = JsonFromOptions(OptionsFor(project, target));
  options["mode"] = ModeOf(project, target);
  return options;
}

// Of the first set of results. What the command line sets for a variant is the variant's.
StageTarget Plain(const StageTarget& target) { return {target.run, "", nlohmann::json::object()}; }

// A variant that sets none of these options shares the reconstruction of the first set. The survey's map is the truth
// that the published method is held against, too: it does not rest on it.
StageTarget ReadAs(const Project& project, const std::string& reader, const StageTarget& target) {
  if (target.variant.empty()) return target;
  if (reader == "survey" && ModeOf(project, target) == "paper") return Plain(target);
  if (IdentityOptions(project, target) != IdentityOptions(project, Plain(target))) return target;
  // A variant made by options of the command line is known by its result.
  const bool made = !project.variants().contains(target.variant) && target.variant != "paper" &&
                    fs::exists(ManifestOf(project, "reconstruct", target));
  return made ? target : Plain(target);
}

fs::path FeaturesOf(const Project& project, const StageTarget& target) {
  return ResultOf(project, "features", Plain(target)) / kFeaturesFile;
}

void MakeReconstruction(const ReconstructRunOptions& options, const std::string& mode, const StageTarget& target,
                        StageContext& context) {
  Run run = context.project.run(target.run);
  const Review& review = context.project.review();
  std::erase_if(run.images, [&](const ImageEntry& i) { return review.ExcludesImage(run.name, i.file, i.stamp_ns); });
  ReconstructedRun made = ReconstructFiles(run, FeaturesOf(context.project, target), options, mode, context);
  context.progress.Begin("writing the solution", 0);
  WriteSolution(SolutionOf(made.job.input, run.name, mode, std::move(made.reconstruction)),
                context.out / kSolutionFile);
}

}  // namespace

std::string ModeOf(const Project& project, const StageTarget& target) {
  std::string mode = "trigpoint";
  for (const OptionLayer& layer : OptionLayers(project, "localize", target)) {
    const auto given = layer.values.find("mode");
    if (given != layer.values.end() && given->is_string()) mode = given->get<std::string>();
  }
  return mode;
}

fs::path ReconstructionManifest(const Project& project, const std::string& reader, const StageTarget& target) {
  return ManifestOf(project, "reconstruct", TargetRead(project, StageNamed("reconstruct"), reader, target));
}

Solution ReadReconstruction(const Project& project, const std::string& reader, const StageTarget& target) {
  const fs::path file = ReconstructionManifest(project, reader, target).parent_path() / kSolutionFile;
  if (!fs::exists(file)) {
    throw InputError("run " + target.run + ": is not reconstructed yet (" + file.string() +
                     " is missing); run `trigpoint reconstruct` first");
  }
  return ReadSolution(file);
}

std::optional<std::string> WhyOdometryIsRefused(const Project& project, const std::string& reader,
                                                const StageTarget& target) {
  const StageInfo& stage = StageNamed("reconstruct");
  const StageTarget its = TargetRead(project, stage, reader, target);
  const auto failure = ReadFailure(project, stage.name, ResultName(stage, its));
  if (!failure || failure->value("refused", "") != kRefusedOdometry) return std::nullopt;
  // The failure may be of other files than those that are there now.
  const StageState state = StateOf(project, MakeRequest(project, stage, its), failure->value("seed", uint64_t{1}));
  if (state != StageState::kFailed) return std::nullopt;
  return failure->value("error", "");
}

StageInfo ReconstructStage() {
  StageInfo info;
  info.name = "reconstruct";
  info.help = "find a run's camera poses and scene points from its images and odometry";
  info.variants = true;
  info.needs = {"features"};
  info.reviewed = {"image"};
  info.metric = "tracks";
  info.read_as = ReadAs;
  UseOptions<ReconstructRunOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const ReconstructRunOptions options = OptionsFor(project, target);
    StageRequest request;
    request.version = 31;
    request.options = IdentityOptions(project, target);
    request.inputs = RunInputs(project, project.run(target.run));
    request.inputs.push_back(ManifestOf(project, "features", Plain(target)));
    request.body = [=, mode = ModeOf(project, target)](StageContext& context) {
      MakeReconstruction(options, mode, target, context);
    };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget& target) -> std::string {
    for (const Run& r : project.site().runs) {
      if (r.name != target.run) continue;
      if (r.images.empty()) return "run " + r.name + " has no images";
    }
    return "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) {
    const nlohmann::json& m = outcome.manifest.at("metrics");
    return fmt::format("{} images, {} tracks, {} observations, features' noise {:.2f} px (1 sigma); {} loops closed\n",
                       m.at("images").get<int>(), m.at("tracks").get<int>(), m.at("observations").get<int64_t>(),
                       m.at("feature_sigma_px").get<double>(), m.at("loops").at("closed").get<int>());
  };
  return info;
}

}  // namespace trigpoint
