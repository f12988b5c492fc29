#include <fmt/format.h>

#include <map>
#include <set>

#include "app/pipeline/drawn_views.h"
#include "app/pipeline/reconstruct_stage.h"
#include "app/pipeline/stage_list.h"
#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "datasets/io/capture_date.h"
#include "datasets/io/credits.h"
#include "datasets/io/source_quality.h"
#include "datasets/io/time_check.h"
#include "datasets/project/reference_parts.h"
#include "datasets/solution/covariance_tables.h"
#include "datasets/solution/solution_file.h"
#include "datasets/solution/solution_model.h"
#include "eval/evidence/world_evidence.h"
#include "localize/files/job.h"
#include "localize/files/localization_notes.h"
#include "localize/files/tables.h"
#include "localize/reconstruct/image_motion.h"
#include "localize/reconstruct/kept_features.h"
#include "localize/references/stitched_sets.h"
#include "localize/run_solution.h"

namespace trigpoint {
namespace {

struct LocalizeStageOptions : LocalizeOptions {
  std::string rig = "auto";  // of a stitched photo set
  UseOptionsOfWorld world;

  LocalizeStageOptions() = default;
  explicit LocalizeStageOptions(const LocalizeOptions& options) : LocalizeOptions(options) {}
  static LocalizeStageOptions ForMode(const std::string& mode) {
    return LocalizeStageOptions(LocalizeOptions::ForMode(mode));
  }
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    LocalizeOptions::Visit(self, visit);
    visit(self.rig,
          {"rig", "", 0, 0,
           "rig of a stitched photo set: fixed (as stitched), scaled (its size is estimated), prior (its photos move "
           "within the uncertainty of stitching), free, or auto (the one with the smallest hold-out error)"});
    visit(self.world.use, {"use", "", 0, 0,
                           "what georeferences the run besides geotags, in its bundle adjustment: control (points on "
                           "tags), tags (of the survey), gps (every fix), with commas between; empty: none"});
    visit(self.world.reference,
          {"reference", "", 0, 0,
           "use the tags of this map: survey, survey@V or a release of this project; empty: the survey's, with use"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = LocalizeOptions::Check();
    static const std::set<std::string> kRigs = {"auto", "fixed", "scaled", "prior", "free"};
    if (kRigs.count(rig) == 0) {
      problems.push_back("option rig is '" + rig + "', expected auto, fixed, scaled, prior or free");
    }
    for (const std::string& problem : world.Check(mode)) problems.push_back(problem);
    return problems;
  }
};

// How long a run is, and how well that is known.
std::string LengthText(const nlohmann::json& metrics) {
  const double sigma = metrics.at("odometry_scale_sigma").get<double>();
  if (!metrics.value("has_odometry", true)) return fmt::format("length known to {:.1f} % (1 sigma)", 100 * sigma);
  return fmt::format("odometry scale {:.4f} +- {:.4f} (1 sigma)", metrics.at("odometry_scale").get<double>(), sigma);
}

std::string LocalizeSummary(const StageOutcome& outcome, const DisplayUnit&) {
  const nlohmann::json& m = outcome.manifest.at("metrics");
  return fmt::format("{} of {} panoramas and photos localized, {} rejected, {} unmatched; {} images; {}\n",
                     m.at("localized").get<int>(), m.at("references").get<int>(), m.at("rejected").get<int>(),
                     m.at("unmatched").get<int>(), m.at("images").get<int>(),
                     m.at("on_earth").get<bool>()
                         ? "georeferenced from " + m.at("earth_source").get<std::string>() + ", " + LengthText(m)
                         : "not georeferenced: " + m.at("earth_reason").get<std::string>());
}

}  // namespace

StageInfo LocalizeStage() {
  StageInfo info;
  info.name = "localize";
  info.help = "find the pose of every camera and panorama of a run";
  info.variants = true;
  info.needs = {"features", "reconstruct", "references"};
  info.reviewed = {"image", "panorama"};
  info.metric = "localized";
  info.flags = {"mode", "use", "reference"};
  info.also_needs = [](const Project& project, const StageTarget& target) {
    return StagesForWorld(ResolveOptions<LocalizeStageOptions>(project, "localize", target).world);
  };
  UseOptions<LocalizeStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const LocalizeStageOptions options = ResolveOptions<LocalizeStageOptions>(project, "localize", target);
    StageRequest request;
    request.version = 36;
    request.options = JsonFromOptions(options);
    const Run& run = project.run(target.run);
    StageTarget plain = target;
    plain.variant.clear();
    request.inputs = RunInputs(project, run);
    for (const char* table : {"panoramas.csv", "photos.csv", "origin.json"}) {
      if (std::filesystem::exists(project.dir() / table)) request.inputs.push_back(project.dir() / table);
    }
    request.inputs.push_back(ManifestOf(project, "features", plain));
    request.inputs.push_back(ReconstructionManifest(project, "localize", target));
    for (const std::filesystem::path& manifest : ReferenceManifests(project)) request.inputs.push_back(manifest);
    const std::filesystem::path features = ResultOf(project, "features", plain) / kFeaturesFile;
    const std::vector<std::filesystem::path> references = ReferenceResults(project);
    // As published, a reference's views share one centre.
    std::map<std::string, std::filesystem::path> rigs;
    if (options.mode != "paper") rigs = StitchedRigs(project);
    for (const auto& [set, dir] : rigs) request.inputs.push_back(dir / "manifest.json");
    AddWorldInputs(project, target.run, target.variant, options.world, &request);
    request.body = [=, name = target.run](StageContext& context) {
      Site site = context.project.site();
      Run r = context.project.run(name);
      const Review& review = context.project.review();
      std::erase_if(r.images, [&](const ImageEntry& i) { return review.ExcludesImage(r.name, i.file, i.stamp_ns); });
      std::erase_if(site.references, [&](const Reference& p) { return review.ExcludesPanorama(p.name); });
      if (options.mode == "paper") LeaveOutSets(&site, context.progress);
      const bool has_odometry = !r.odometry.poses.empty();
      FollowReconstruction(ReconstructionManifest(context.project, "localize", target).parent_path(), &r, &site);
      LocalizeJob job = MakeLocalizeJob(site, r, context.project.has_frame(), context.project.frame(), features,
                                        references, ViewOptionsOf(context.project), rigs);
      job.input.has_odometry = has_odometry;
      for (const std::string& w : job.warnings) context.progress.Log(LogLevel::kWarning, w);
      LocalizeOptions how = options;
      if (options.world.Parts().count("gps") > 0) how.geo.use_gps = "always";
      const WorldSources world(context.project, target.run, target.variant, options.world, job);
      std::vector<SetRefinement> sets;
      const auto refine = [&](const Reconstruction& reconstruction, const Retrieval& retrieval,
                              std::vector<ReferenceViews>* placed, std::vector<Registration>* answers) {
        sets = RefineSets(job.input, job.shapes, options.registration, options.rig, reconstruction, retrieval,
                          context.seed, context.progress, context.cancel, placed, answers);
      };
      SolutionCounts counts;
      Localization result = LocalizeAtItsLength(has_odometry, [&](double length) {
        Solution alone = ReadReconstruction(context.project, "localize", target);
        counts = alone.counts;
        if (!HasAlignedPoints(counts)) job.input.reference_pictures = nullptr;
        Reconstruction reconstruction = ReconstructionOf(job.input, std::move(alone));
        if (length != 1) ScaleReconstruction(length, &reconstruction);
        const WorldEvidence evidence =
            world.EvidenceFor(reconstruction, context.threads, context.progress, context.cancel);
        return Localize(job.input, std::move(reconstruction), job.gps, how, context.threads, context.seed,
                        context.progress, context.cancel, refine, evidence);
      });
      NoteLocalization(site, r, job, sets, counts, &result, context);
      WriteLocalization(site, job, result, context.out);
      WriteRigs(sets, result, context.out);
      Solution solution = SolutionOf(job.input, r.name, options.mode, counts, &result);
      if (solution.georeference && result.world.frame >= 0) {
        solution.georeference->evidence = world.EvidenceOf(result.world);
        context.metrics["world"]["evidence"] = solution.georeference->evidence;
      }
      WriteLocalizedSolution(site, job, result, &solution, context.out);
    };
    // The frame of the answers is the project's; an edit of trigpoint.yaml that moves it makes them out of date.
    if (project.has_frame()) {
      const Geodetic& o = project.frame().origin();
      request.values["origin"] = {o.latitude_deg, o.longitude_deg, o.height_m};
    }
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget& target) -> std::string {
    for (const Run& r : project.site().runs) {
      if (r.name == target.run && r.images.empty()) return "run " + r.name + " has no images";
    }
    return "";
  };
  info.summary = LocalizeSummary;
  return info;
}

}  // namespace trigpoint
