#include "eval/errors/evaluated_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "calib/base/counted.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/odometry_limits.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "eval/errors/changed_errors.h"
#include "eval/evidence/rolling_tags.h"
#include "eval/evidence/tag_views.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_shape.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

TagDerivatives DerivativesOf(const Solution& solution, const OwnViews& own, const std::vector<TagEstimate>& tags) {
  std::map<std::pair<int64_t, std::string>, int> index;
  for (size_t i = 0; i < solution.images.size(); ++i) {
    const SolutionImage& image = solution.images[i];
    index[{image.stamp_ns, solution.cameras[static_cast<size_t>(image.camera)].name}] = static_cast<int>(i);
  }
  TagDerivatives derivatives;
  for (const TagEstimate& tag : tags) {
    for (size_t k = 0; k < tag.views.size(); ++k) {
      const auto image = index.find(own.images[static_cast<size_t>(tag.views[k])]);
      if (image != index.end()) derivatives[tag.tag_id].emplace_back(image->second, tag.by_camera[k]);
    }
  }
  return derivatives;
}

TagResult ToTagResult(const TagEstimate& tag) {
  TagResult result;
  result.tag_id = tag.tag_id;
  result.family = tag.family;
  result.size_m = tag.size_m;
  result.map_from_tag = tag.world_from_tag;
  if (tag.HasPose()) {
    result.sigma_m = tag.covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
    result.covariance = tag.covariance;
  }
  result.images = tag.images;
  result.runs = tag.runs;
  result.rms_px = tag.rms_px;
  result.role = tag.role;
  result.status = tag.status;
  return result;
}

// What the global fit of a result rests on of the run's own references and GPS, one name each. `source`: as
// SolutionGeoreference::source.
std::vector<std::string> EvidenceOf(const Run& run, const LocalizeResult& result, const std::string& source) {
  std::vector<std::string> evidence;
  if (source.find("gps") != std::string::npos) evidence.push_back("gps:" + run.name);
  for (const PanoramaResult& panorama : result.panoramas) {
    if (panorama.status != "localized") continue;
    if (source.find("geotags") != std::string::npos) evidence.push_back("geotag:" + panorama.panorama);
    evidence.push_back("photos:" + panorama.panorama);  // shared with maps that are made of them
  }
  return evidence;
}

// 1 sigma of a stitched rig's centre per axis: its photos' centres scatter about it.
double StitchSigma(const fs::path& rig_csv) {
  const CsvTable table = CsvTable::Read(rig_csv, {"photo", "sigma_tx_m", "sigma_ty_m", "sigma_tz_m"});
  double sum = 0;
  for (const CsvRow& row : table.rows()) {
    for (const char* column : {"sigma_tx_m", "sigma_ty_m", "sigma_tz_m"}) sum += std::pow(row.Number(column, 0), 2);
  }
  const double n = static_cast<double>(table.rows().size());
  return n > 0 ? std::sqrt(sum / 3) / n : 0;
}

// The run's own tags, by its detections; where errors of its cameras take them.
TagDerivatives AddOwnTags(const TagPosesOptions& options, const Run& run, const Solution* solution,
                          StageContext& context, EvaluatedRun* evaluated) {
  const fs::path detections = context.project.ResultDir("detect", run.name) / "detections.csv";
  if (!fs::exists(detections)) return {};
  std::vector<std::string> warnings;
  std::vector<ImageDetections> images = ReadDetections(detections, options.extra_sigma_px, &warnings);
  LeaveOutExcluded(context.project.review(), run.name, images);
  Run seen = run;
  if (solution != nullptr) TakeLenses(solution->cameras, &seen.cameras);
  MoveToImageTimes(seen, context.project.site().tags, &images);
  const OwnViews own = TagViews(seen, evaluated->result, solution, images);
  const auto estimate = [&](const TagSizes& sizes) {
    return EstimateTagPoses(own.views, sizes, options, context.threads, context.progress, context.cancel);
  };
  // Without odometry the frame has no scale of its own, and the fit to the Earth says roughly how long a metre is.
  const bool scaled = !run.odometry.poses.empty();
  const double about = scaled || !evaluated->result.world_from_odom ? 1 : 1 / evaluated->result.world_from_odom->scale;
  const TagSizes& stated = context.project.site().tags;
  std::vector<TagEstimate> tags = estimate(stated.Scaled(about));
  constexpr double kUnknown = 10;
  const CommonRatio ratio = CommonSizeRatio(MeasureTagShapes(own.views, tags, options.extra_sigma_px),
                                            scaled ? run.config.odometry_scale_sigma : kUnknown);
  const double metre = about * ratio.ratio;
  context.progress.Log(LogLevel::kInfo, fmt::format("{}: by its {} a metre is {:.4f} m (1 sigma {:.4f} m) in its frame",
                                                    run.name, Counted(ratio.tags, "tag"), metre, about * ratio.sigma));
  tags = estimate(stated.Scaled(metre));
  for (TagEstimate& tag : tags) tag.size_m /= metre;
  evaluated->self_metre = metre;
  WriteTags(context.out / ("tags_" + ResultNameOf(run.name, evaluated->variant) + ".csv"), tags, "odom",
            "cameras of " + run.name);
  for (const TagEstimate& tag : tags) evaluated->self_tags.push_back(ToTagResult(tag));
  return solution == nullptr ? TagDerivatives() : DerivativesOf(*solution, own, tags);
}

void SetRotationSigmas(const Solution& solution, EvaluatedRun* evaluated) {
  for (const SolutionReference& r : solution.references) {
    if (!solution.georeference || solution.covariances.empty() || r.pose < 0) continue;
    const Matrix6d c = WorldCovariance(solution, r.pose);
    evaluated->sigma_rot_rad.emplace(r.row, std::sqrt(c.topLeftCorner<3, 3>().trace() / 3));
  }
}

// A run's localize result with everything the evaluation wants to know of it. Throws InputError for a broken one.
EvaluatedRun ReadEvaluatedRun(const TagPosesOptions* own_tags, const Run& run, const std::string& variant,
                              const nlohmann::json& manifest, const std::vector<Station>& stations,
                              StageContext& context) {
  const Project& project = context.project;
  EvaluatedRun evaluated;
  evaluated.run = run.name;
  evaluated.variant = variant;
  const std::string mode = manifest.value("options", nlohmann::json::object()).value("mode", "trigpoint");
  evaluated.method = mode == "paper" ? "g2" : "single";
  evaluated.odometry_levelled = run.config.odometry_levelled && !IsFlat(run.odometry);
  const fs::path dir = project.ResultDir("localize", ResultNameOf(run.name, variant));
  std::optional<Solution> solution;  // none: of an older program
  if (fs::exists(dir / kSolutionFile)) solution = ReadSolution(dir / kSolutionFile);
  const Solution* const its = solution ? &*solution : nullptr;
  evaluated.result = ReadLocalizeResult(dir, its);
  std::string source = manifest.value("metrics", nlohmann::json::object()).value("earth_source", "");
  if (solution) source = solution->georeference ? solution->georeference->source : "";
  evaluated.evidence = EvidenceOf(run, evaluated.result, source);
  if (solution && solution->georeference) {
    const std::vector<std::string>& used = solution->georeference->evidence;
    evaluated.evidence.insert(evaluated.evidence.end(), used.begin(), used.end());
  }
  if (HasColmapModel(dir / "sparse")) evaluated.structure = StructureOf(ReadColmapModel(dir / "sparse"));
  for (const PanoramaResult& row : evaluated.result.panoramas) {
    const fs::path rig = project.ResultDir("stitch", fs::path(row.panorama).filename().string()) / "rig.csv";
    if (!row.panorama.empty() && fs::exists(rig)) evaluated.stitch_sigma[row.panorama] = StitchSigma(rig);
  }
  TagDerivatives by_camera;
  if (own_tags != nullptr) by_camera = AddOwnTags(*own_tags, run, its, context, &evaluated);
  if (solution) {
    SetRotationSigmas(*solution, &evaluated);
    evaluated.covariances =
        CovariancesOfAnswers(*solution, evaluated.self_tags, by_camera, stations, context.threads, context.cancel);
  }
  return evaluated;
}

void AddEvaluatedSite(const std::string& variant, const std::vector<Station>& stations, StageContext& context,
                      EvaluatedSite* out) {
  EvaluatedSite& site = *out;
  const fs::path file = context.project.ResultDir("site", ResultNameOf("", variant)) / kSolutionFile;
  if (!fs::exists(file)) return;
  const Solution solution = ReadSolution(file);
  EvaluatedRun all;
  all.run = "site";
  all.variant = ResultNameOf("site", variant);  // beside the runs alone
  all.odometry_levelled = true;                 // it lies in the world
  all.evidence = solution.georeference->evidence;
  for (size_t i = 0; i < solution.runs.size(); ++i) {
    const Solution part = PartOfRun(solution, i);
    EvaluatedRun& cameras = site.cameras.emplace_back();
    cameras.run = part.run;
    cameras.variant = all.variant;
    cameras.result = ReadLocalizeResult(file.parent_path(), &part);
    // A station is passed by the site where a run passes it.
    all.result.cameras.insert(all.result.cameras.end(), cameras.result.cameras.begin(), cameras.result.cameras.end());
    if (i == 0) all.result.panoramas = cameras.result.panoramas;
    for (const std::string& item :
         EvidenceOf(context.project.run(part.run), cameras.result, solution.georeference->source))
      all.evidence.push_back(item);
  }
  SetRotationSigmas(solution, &all);
  all.covariances = CovariancesOfAnswers(solution, {}, {}, stations, context.threads, context.cancel);
  site.answers.push_back(std::move(all));
}

}  // namespace

std::vector<const Run*> EvaluatedRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "survey") runs.push_back(&run);
  }
  return runs;
}

std::vector<std::string> EvaluatedVariants(const Project& project, const std::vector<std::string>& known) {
  std::vector<std::string> variants;
  for (const std::string& variant : known) {
    const std::vector<const Run*> runs = EvaluatedRuns(project);
    const bool localized = std::any_of(runs.begin(), runs.end(), [&](const Run* run) {
      return fs::exists(project.ResultDir("localize", ResultNameOf(run->name, variant)) / "manifest.json");
    });
    if (variants.empty() || localized) variants.push_back(variant);
  }
  return variants;
}

std::vector<EvaluatedRun> ReadEvaluatedRuns(const TagPosesOptions* own_tags, const std::vector<std::string>& variants,
                                            const std::vector<Station>& stations, StageContext& context,
                                            std::vector<std::string>* notes) {
  std::vector<EvaluatedRun> runs;
  for (const std::string& variant : variants) {
    for (const Run* run : EvaluatedRuns(context.project)) {
      const std::string name = ResultNameOf(run->name, variant);
      const auto manifest = ReadManifest(context.project, "localize", name);
      if (!manifest) {
        // Another variant may have been made of some runs only.
        const LogLevel level = variant == variants.front() ? LogLevel::kWarning : LogLevel::kInfo;
        context.progress.Log(level, "run " + name + " is not localized and takes no part");
        continue;
      }
      if (const auto failure = ReadFailure(context.project, "localize", name)) {
        notes->push_back("The numbers of run " + name + " are of an older result, made " + manifest->value("end", "") +
                         ": localizing it again failed.");
        context.progress.Log(LogLevel::kWarning, notes->back());
      }
      try {
        runs.push_back(ReadEvaluatedRun(own_tags, *run, variant, *manifest, stations, context));
      } catch (const InputError& e) {
        context.progress.Log(LogLevel::kWarning, "run " + name + " takes no part: " + e.what());
      }
    }
  }
  return runs;
}

EvaluatedSite ReadEvaluatedSites(const std::vector<std::string>& variants, const std::vector<Station>& stations,
                                 StageContext& context) {
  EvaluatedSite site;
  for (const std::string& variant : variants) AddEvaluatedSite(variant, stations, context, &site);
  return site;
}

}  // namespace trigpoint
