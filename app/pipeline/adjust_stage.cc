// site: several runs in one adjustment (localize/site), from what `localize` found of each.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "app/pipeline/drawn_views.h"
#include "app/pipeline/reconstruct_stage.h"
#include "app/pipeline/stage_list.h"
#include "calib/base/counted.h"
#include "datasets/project/reference_parts.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "eval/evidence/world_evidence.h"
#include "localize/files/job.h"
#include "localize/reconstruct/image_motion.h"
#include "localize/reconstruct/kept_features.h"
#include "localize/references/stitched_sets.h"
#include "localize/site/adjust_site.h"
#include "localize/site/tables.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct SiteStageOptions : SiteOptions {
  std::string runs;  // with commas between; empty: all
  UseOptionsOfWorld world;

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    SiteOptions::Visit(self, visit);
    visit(self.runs, {"runs", "", 0, 0, "the runs to adjust, with commas between; empty: all that have images"});
    visit(self.world.use, {"use", "", 0, 0,
                           "what holds the site besides geotags: control (points on tags), tags (of the survey), gps "
                           "(every fix), with commas between; empty: none"});
    visit(self.world.reference, {"reference", "", 0, 0,
                                 "use the tags of this map: survey, survey@V or a release of this project; empty: the "
                                 "survey's, with use"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = SiteOptions::Check();
    for (const std::string& problem : world.Check("trigpoint")) problems.push_back(problem);
    return problems;
  }
};

std::vector<std::string> RunsOf(const Project& project, const SiteStageOptions& options) {
  std::vector<std::string> runs;
  std::istringstream text(options.runs);
  for (std::string run; std::getline(text, run, ',');) {
    std::erase(run, ' ');
    if (run.empty() || std::find(runs.begin(), runs.end(), run) != runs.end()) continue;
    project.run(run);  // throws, naming the nearest one
    runs.push_back(run);
  }
  if (!runs.empty()) return runs;
  for (const Run& run : project.site().runs) {
    if (!run.images.empty()) runs.push_back(run.name);
  }
  return runs;
}

StageTarget Localized(const std::string& run, const StageTarget& target) { return {run, target.variant, {}}; }

// A run with all that is read of it; `job` holds its feature store open.
struct RunToAdjust {
  LocalizeJob job;
  SiteRun run;
};

RunToAdjust ReadRun(const StageContext& context, const std::string& name, const StageTarget& target) {
  const Project& project = context.project;
  const StageTarget localized = Localized(name, target);
  const fs::path file = ResultOf(project, "localize", localized) / kSolutionFile;
  if (!fs::exists(file)) {
    throw InputError(file.string() + " is not there; run `trigpoint localize " + project.dir().string() + " --run " +
                     name + "` first");
  }
  StageTarget plain = localized;
  plain.variant.clear();
  Site site = project.site();
  Run run = project.run(name);
  const Review& review = project.review();
  std::erase_if(run.images, [&](const ImageEntry& i) { return review.ExcludesImage(name, i.file, i.stamp_ns); });
  std::erase_if(site.references, [&](const Reference& p) { return review.ExcludesPanorama(p.name); });
  const bool has_odometry = !run.odometry.poses.empty();
  FollowReconstruction(ReconstructionManifest(project, "localize", localized).parent_path(), &run);
  RunToAdjust out;
  out.job = MakeLocalizeJob(site, run, project.has_frame(), project.frame(),
                            ResultOf(project, "features", plain) / kFeaturesFile, ReferenceResults(project),
                            ViewOptionsOf(project), StitchedRigs(project));
  out.job.input.has_odometry = has_odometry;
  out.run.name = name;
  out.run.solution = ReadSolution(file);
  out.run.input = out.job.input;
  out.run.gps = out.job.gps;
  if (out.run.solution.mode == "paper") {
    throw InputError(
        "run " + name +
        " is localized in mode paper, which gives no joint solution of images and panoramas; expected a result of "
        "mode trigpoint");
  }
  return out;
}

// Tags that a map or control points place, of all runs, each once; with the map's covariance.
WorldEvidence EvidenceOf(const std::vector<SiteRun>& runs, const WorldSources& sources, bool gps,
                         ProgressSink& progress) {
  WorldEvidence evidence;
  evidence.gps = gps;
  for (const SiteRun& run : runs) {
    for (const WorldTag& tag : run.tags) {
      const bool known = std::any_of(evidence.tags.begin(), evidence.tags.end(),
                                     [&](const WorldTag& other) { return other.id == tag.id; });
      if (known || (!tag.world_from_tag && tag.control.empty())) continue;
      evidence.tags.push_back(tag);
    }
  }
  evidence.map_covariance = sources.MapCovariance(evidence.tags, progress);
  return evidence;
}

nlohmann::json MetricsOf(const SiteAdjustment& site) {
  const Solution& s = site.solution;
  const auto localized = std::count_if(s.references.begin(), s.references.end(),
                                       [](const SolutionReference& r) { return r.status == "localized"; });
  nlohmann::json m = {
      {"runs", site.runs.size()},        {"images", s.images.size()},       {"references", s.references.size()},
      {"localized", localized},          {"tags", site.tags.size()},        {"earth_source", s.georeference->source},
      {"links_tried", site.links_tried}, {"links_found", site.links_found}, {"links_refused", site.links_refused}};
  for (const RunInSite& run : site.runs) {
    m["of_run"].push_back({{"run", run.name},
                           {"images", run.images},
                           {"shared_panoramas", run.shared_panoramas},
                           {"shared_tags", run.shared_tags},
                           {"shared_points", run.shared_points},
                           {"odometry_scale", run.scale},
                           {"odometry_scale_sigma", run.scale_sigma},
                           {"largest_move_m", run.largest_move_m}});
  }
  double worst = 0;
  for (const SolutionReference& r : s.references) {
    if (r.pose >= 0) worst = std::max(worst, WorldCovariance(s, r.pose).diagonal().tail<3>().maxCoeff());
  }
  m["largest_panorama_sigma_m"] = std::sqrt(worst);
  return m;
}

void AdjustProject(const SiteStageOptions& options, const StageTarget& target, StageContext& context) {
  const std::vector<std::string> names = RunsOf(context.project, options);
  std::vector<RunToAdjust> jobs;
  jobs.reserve(names.size());  // sources refer to them
  std::vector<SiteRun> runs;
  std::vector<WorldSources> sources;
  for (const std::string& name : names) {
    jobs.push_back(ReadRun(context, name, target));
    SiteRun& run = jobs.back().run;
    const StageTarget localized = Localized(name, target);
    sources.emplace_back(context.project, localized.run, localized.variant, options.world, jobs.back().job, true);
    for (const std::string& warning : sources.back().warnings()) {
      context.progress.Log(LogLevel::kWarning, name + ": " + warning);
    }
    run.tags = sources.back().TagsOf(run.solution.problem.poses, context.threads, context.progress, context.cancel);
    runs.push_back(std::move(run));
  }
  const bool gps = options.world.Parts().count("gps") > 0;
  const WorldEvidence evidence = EvidenceOf(runs, sources.front(), gps, context.progress);
  SiteAdjustment site =
      AdjustSite(std::move(runs), evidence, options, context.threads, context.seed, context.progress, context.cancel);
  for (const std::string& warning : site.warnings) context.progress.Log(LogLevel::kWarning, warning);
  std::set<std::string> rests_on;
  for (size_t i = 0; i < names.size(); ++i) {
    const auto is_it = [&](const RunInSite& run) { return run.name == names[i]; };
    if (std::none_of(site.runs.begin(), site.runs.end(), is_it)) continue;  // left out
    const std::vector<std::string> of_run = sources[i].EvidenceOf(site.fit);
    rests_on.insert(of_run.begin(), of_run.end());
    rests_on.insert("tags:" + names[i]);  // what is made of these images shares their errors
  }
  site.solution.georeference->evidence.assign(rests_on.begin(), rests_on.end());
  WriteSolution(site.solution, context.out / kSolutionFile);
  WriteSiteTables(site, context.out);
  context.metrics.update(MetricsOf(site));
}

// What the command ends with, from the manifest's metrics.
std::string SiteSummary(const nlohmann::json& m, const DisplayUnit& unit) {
  std::string text = fmt::format(
      "{} adjusted together, {}; {} of {} panoramas and photos localized, largest sigma {:.3f} {} (1 sigma, worst "
      "axis); "
      "datum {}\n",
      Counted(m.at("runs").get<int64_t>(), "run", "runs"), Counted(m.at("images").get<int64_t>(), "image", "images"),
      m.at("localized").get<int>(), m.at("references").get<int>(),
      m.at("largest_panorama_sigma_m").get<double>() / unit.metres, unit.name, m.at("earth_source").get<std::string>());
  for (const nlohmann::json& run : m.at("of_run")) {
    text += fmt::format("{}: shares {}, {}, {} with other runs; odometry scale {:.4f} +- {:.4f} (1 sigma)\n",
                        run.at("run").get<std::string>(),
                        Counted(run.at("shared_panoramas").get<int64_t>(), "panorama", "panoramas"),
                        Counted(run.at("shared_tags").get<int64_t>(), "tag", "tags"),
                        Counted(run.at("shared_points").get<int64_t>(), "point", "points"),
                        run.at("odometry_scale").get<double>(), run.at("odometry_scale_sigma").get<double>());
  }
  return text;
}

}  // namespace

StageInfo SiteStage() {
  StageInfo info;
  info.name = "site";
  info.command = "adjust";
  info.help = "adjust several runs together: one solution of the site with one datum";
  info.per_run = false;
  info.variants = true;
  info.first_on_request = true;
  info.needs = {"features", "references", "detect", "reconstruct", "localize"};
  info.reviewed = {"image", "panorama", "detection", "tag", "control"};  // tags link runs without `use`, too
  info.metric = "largest_panorama_sigma_m";
  info.flags = {"use", "reference"};
  info.also_needs = [](const Project& project, const StageTarget& target) {
    return StagesForWorld(ResolveOptions<SiteStageOptions>(project, "site", target).world);
  };
  UseOptions<SiteStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<SiteStageOptions>(project, "site", target);
    StageRequest request;
    request.version = 6;
    request.options = JsonFromOptions(options);
    for (const std::string& run : RunsOf(project, options)) {
      const StageTarget localized = Localized(run, target);
      request.inputs.push_back(ManifestOf(project, "localize", localized));
      const fs::path detections = ManifestOf(project, "detect", {run, "", {}});
      if (fs::exists(detections)) {
        request.inputs.push_back(detections);
        if (fs::exists(project.dir() / "tags.yaml")) request.inputs.push_back(project.dir() / "tags.yaml");
      }
      AddWorldInputs(project, localized.run, localized.variant, options.world, &request);
      request.values["runs"].push_back(run);
    }
    std::sort(request.inputs.begin(), request.inputs.end());
    request.inputs.erase(std::unique(request.inputs.begin(), request.inputs.end()), request.inputs.end());
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options, target](StageContext& context) { AdjustProject(options, target, context); };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget&) -> std::string {
    for (const Run& run : project.site().runs) {
      if (!run.images.empty()) return "";
    }
    return "no run has images";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    return SiteSummary(outcome.manifest.at("metrics"), unit);
  };
  return info;
}

}  // namespace trigpoint
