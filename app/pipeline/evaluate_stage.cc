// evaluate: the localized panoramas of all runs against tags and control points.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "app/pipeline/jobs.h"
#include "app/pipeline/measured_offsets.h"
#include "app/pipeline/rolling_tags.h"
#include "app/pipeline/stage_list.h"
#include "app/pipeline/tag_views.h"
#include "calib/base/counted.h"
#include "datasets/io/camchain.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "datasets/solution/solution_covariance.h"
#include "datasets/solution/solution_file.h"
#include "eval/errors/evaluation_files.h"
#include "eval/errors/reference_maps.h"
#include "eval/errors/rotation_errors.h"
#include "eval/gates/limits.h"
#include "eval/trajectory/score_estimates.h"
#include "eval/truth/truth.h"
#include "survey/tags/excluded_detections.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_shape.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

struct EvaluateStageOptions {
  EvaluateOptions errors;
  TagPosesOptions tags;
  EvaluateLimits gates;  // judged by the stage `gates`
  EstimateScoreOptions estimates;
  std::string reference;           // empty: self, control, survey
  std::string offsets = "stated";  // of stations: stated, estimated, combined
  std::string truth;               // a folder of true poses
  bool paper_tables = false;       // the paper's own two tables beside ours
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    EvaluateOptions::Visit(self.errors, visit);
    visit(self.tags, {"tags", "", 0, 0, "tag poses from the run's own cameras"});
    EvaluateLimits::Visit(self.gates, visit);
    visit(self.estimates,
          {"estimates", "", 0, 0, "cameras and other systems' trajectories against the reference poses"});
    visit(self.reference,
          {"reference", "", 0, 0,
           "compare with this reference only: self, control, survey, survey@V or a release; empty: the first three"});
    visit(self.offsets,
          {"offsets", "", 0, 0,
           "station offsets: stated (stations.csv), estimated by the tags that panoramas show (survey), or "
           "combined"});
    visit(self.truth,
          {"truth", "", 0, 0, "a folder of true poses (runs/<run>_cameras.tum, panoramas.tum) to score against"});
    visit(self.paper_tables, {"paper_tables", "", 0, 1, "print the published tables of the paper too"});
  }
  std::vector<std::string> Check() const {
    std::vector<std::string> problems = errors.Check();
    for (const std::string& problem : tags.Check()) problems.push_back("tags: " + problem);
    for (const std::string& problem : CheckOffsets(offsets)) problems.push_back(problem);
    for (const std::string& problem : CheckRanges(gates)) problems.push_back(problem);
    return problems;
  }
};

// Runs whose results are held against something.
std::vector<const Run*> EvaluatedRuns(const Project& project) {
  std::vector<const Run*> runs;
  for (const Run& run : project.site().runs) {
    if (run.config.role != "survey") runs.push_back(&run);
  }
  return runs;
}

StageTarget TargetOf(const std::string& run, const std::string& variant) {
  StageTarget target;
  target.run = run;
  target.variant = variant;
  return target;
}

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

// Name of what several runs were adjusted to, as a variant beside the runs alone.
std::string SiteVariant(const std::string& variant) { return variant.empty() ? "site" : "site@" + variant; }

// The variants whose results stand side by side: the one asked for; for the first set, all that there are.
std::vector<std::string> EvaluatedVariants(const Project& project, const std::string& variant) {
  if (!variant.empty()) return {variant};
  std::vector<std::string> variants = {""};
  for (const std::string& other : KnownVariants(project)) {
    if (other.empty()) continue;
    for (const Run* run : EvaluatedRuns(project)) {
      if (!fs::exists(ManifestOf(project, "localize", TargetOf(run->name, other)))) continue;
      variants.push_back(other);
      break;
    }
  }
  return variants;
}

// The maps to hold results against. One that cannot be read is named and left out, unless it was asked for.
std::vector<ReferenceMap> ReferencesFor(const Project& project, const std::string& asked, ProgressSink& progress) {
  std::vector<ReferenceMap> maps;
  const auto add = [&](const std::string& name) {
    const fs::path folder = ReferenceMapFolder(project, name);
    maps.push_back(ReadReferenceMap(project, folder, name));
    const std::string missing = MissingCovariances(maps.back(), folder);
    if (!missing.empty()) progress.Log(LogLevel::kWarning, missing);
  };
  if (asked == "self") return maps;
  if (!asked.empty() && asked != "control") {
    const std::vector<std::string> names = ReferenceNames(project);
    if (std::find(names.begin(), names.end(), asked) == names.end()) {
      throw InputError("there is no reference '" + asked + "'; nearest: '" + NearestName(asked, names) +
                       "' (there are " + fmt::format("{}", fmt::join(names, ", ")) + ")");
    }
    add(asked);
    return maps;
  }
  if (ReferenceMap control = ControlMap(project); !control.tags.empty()) maps.push_back(std::move(control));
  if (asked == "control" && maps.empty()) throw InputError("there is no reference 'control': no control_points.csv");
  if (asked.empty() && fs::exists(ReferenceMapFolder(project, "survey") / "tags.csv")) {
    try {
      add("survey");
    } catch (const InputError& e) {
      progress.Log(LogLevel::kWarning, std::string("the survey cannot be used as reference: ") + e.what());
    }
  }
  return maps;
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
TagDerivatives AddOwnTags(const EvaluateStageOptions& options, const Run& run, const StageTarget& target,
                          const Solution* solution, StageContext& context, EvaluatedRun* evaluated) {
  const fs::path detections = ResultOf(context.project, "detect", target) / "detections.csv";
  if (!fs::exists(detections)) return {};
  std::vector<std::string> warnings;
  std::vector<ImageDetections> images = ReadDetections(detections, options.tags.extra_sigma_px, &warnings);
  LeaveOutExcluded(context.project.review(), run.name, images);
  Run seen = run;
  if (solution != nullptr) TakeLenses(solution->cameras, &seen.cameras);
  MoveToImageTimes(seen, context.project.site().tags, &images);
  const OwnViews own = TagViews(seen, evaluated->result, solution, images);
  const auto estimate = [&](const TagSizes& sizes) {
    return EstimateTagPoses(own.views, sizes, options.tags, context.threads, context.progress, context.cancel);
  };
  // Without odometry the frame has no scale of its own, and the fit to the Earth says roughly how long a metre is.
  const bool scaled = !run.odometry.poses.empty();
  const double about = scaled || !evaluated->result.world_from_odom ? 1 : 1 / evaluated->result.world_from_odom->scale;
  const TagSizes& stated = context.project.site().tags;
  std::vector<TagEstimate> tags = estimate(stated.Scaled(about));
  constexpr double kUnknown = 10;
  const CommonRatio ratio = CommonSizeRatio(MeasureTagShapes(own.views, tags, options.tags.extra_sigma_px),
                                            scaled ? run.config.odometry_scale_sigma : kUnknown);
  const double metre = about * ratio.ratio;
  context.progress.Log(LogLevel::kInfo, fmt::format("{}: by its {} a metre is {:.4f} m (1 sigma {:.4f} m) in its frame",
                                                    run.name, Counted(ratio.tags, "tag"), metre, about * ratio.sigma));
  tags = estimate(stated.Scaled(metre));
  for (TagEstimate& tag : tags) tag.size_m /= metre;
  evaluated->self_metre = metre;
  WriteTags(context.out / ("tags_" + ResultName(StageNamed("localize"), target) + ".csv"), tags, "odom",
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
EvaluatedRun ReadEvaluatedRun(const EvaluateStageOptions& options, const Run& run, const StageTarget& target,
                              const nlohmann::json& manifest, const std::vector<Station>& stations,
                              StageContext& context) {
  const Project& project = context.project;
  EvaluatedRun evaluated;
  evaluated.run = run.name;
  evaluated.variant = target.variant;
  const std::string mode = manifest.value("options", nlohmann::json::object()).value("mode", "trigpoint");
  evaluated.method = mode == "paper" ? "g2" : "single";
  evaluated.odometry_levelled = run.config.odometry_levelled;
  const fs::path dir = ResultOf(project, "localize", target);
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
  if (options.reference.empty() || options.reference == "self") {
    by_camera = AddOwnTags(options, run, target, its, context, &evaluated);
  }
  if (solution) {
    SetRotationSigmas(*solution, &evaluated);
    evaluated.covariances =
        CovariancesOfAnswers(*solution, evaluated.self_tags, by_camera, stations, context.threads, context.cancel);
  }
  return evaluated;
}

// All localized runs of all variants side by side; one that cannot be read is named, and the others go on.
// A result whose newest attempt failed is an older one: said in the tables too, so that it does not pass for the new.
std::vector<EvaluatedRun> ReadEvaluatedRuns(const EvaluateStageOptions& options, const std::string& variant,
                                            const std::vector<Station>& stations, StageContext& context,
                                            std::vector<std::string>* notes) {
  std::vector<EvaluatedRun> runs;
  for (const std::string& each : EvaluatedVariants(context.project, variant)) {
    for (const Run* run : EvaluatedRuns(context.project)) {
      const StageTarget target = TargetOf(run->name, each);
      const std::string name = ResultName(StageNamed("localize"), target);
      const auto manifest = ReadManifest(context.project, "localize", name);
      if (!manifest) {
        // Another variant may have been made of some runs only.
        const LogLevel level = each == variant ? LogLevel::kWarning : LogLevel::kInfo;
        context.progress.Log(level, "run " + name + " is not localized and takes no part");
        continue;
      }
      if (const auto failure = ReadFailure(context.project, "localize", name)) {
        notes->push_back("The numbers of run " + name + " are of an older result, made " + manifest->value("end", "") +
                         ": localizing it again failed.");
        context.progress.Log(LogLevel::kWarning, notes->back());
      }
      try {
        runs.push_back(ReadEvaluatedRun(options, *run, target, *manifest, stations, context));
      } catch (const InputError& e) {
        context.progress.Log(LogLevel::kWarning, "run " + name + " takes no part: " + e.what());
      }
    }
  }
  return runs;
}

// What several runs were adjusted to: its panoramas as one result, its cameras for each run.
struct EvaluatedSite {
  std::vector<EvaluatedRun> answers, cameras;
};

void AddEvaluatedSite(const std::string& variant, const std::vector<Station>& stations, StageContext& context,
                      EvaluatedSite* out) {
  EvaluatedSite& site = *out;
  const fs::path file = ResultOf(context.project, "site", TargetOf("", variant)) / kSolutionFile;
  if (!fs::exists(file)) return;
  const Solution solution = ReadSolution(file);
  EvaluatedRun all;
  all.run = "site";
  all.variant = SiteVariant(variant);
  all.odometry_levelled = true;  // it lies in the world
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

// Scores against true poses: truth.json, and a paragraph for people.
void ScoreTruth(const EvaluateStageOptions& options, const std::vector<EvaluatedRun>& runs, StageContext& context,
                std::vector<std::string>* notes) {
  const fs::path given = options.truth;
  const fs::path dir = given.is_absolute() ? given : context.project.dir() / given;
  if (!fs::is_directory(dir)) {
    throw InputError("truth " + dir.string() + ": expected a folder with runs/<run>_cameras.tum, found none");
  }
  nlohmann::json all = nlohmann::json::array();
  std::string first;
  for (const EvaluatedRun& run : runs) {
    const std::string name = run.variant.empty() ? run.run : run.run + "@" + run.variant;
    try {
      const TruthEvaluation truth = EvaluateAgainstTruth(run.result, ReadTruth(dir, run.run));
      all.push_back(TruthJson(truth));
      all.back()["run"] = run.run;
      all.back()["variant"] = run.variant;
      notes->push_back("Against true poses, " + name + ": " + Describe(truth));
    } catch (const InputError& e) {
      if (first.empty()) first = e.what();
      context.progress.Log(LogLevel::kWarning, "run " + name + " is not scored against true poses: " + e.what());
    }
  }
  if (all.empty() && !first.empty()) throw InputError("truth " + dir.string() + ": no run can be scored: " + first);
  WriteFileAtomically(context.out / "truth.json",
                      nlohmann::json{{"schema", "trigpoint truth 1"}, {"unit", "m"}, {"runs", all}}.dump(2) + "\n");
}

void SetMetrics(const Evaluation& evaluation, const std::string& variant, nlohmann::json* metrics) {
  nlohmann::json groups = nlohmann::json::array();
  int best = 0;
  for (const GroupSummary& group : evaluation.groups) {
    nlohmann::json entry = {{"variant", group.group.variant},
                            {"method", group.group.method},
                            {"reference", group.group.reference},
                            {"kind", group.group.kind},
                            {"attempts", group.attempts},
                            {"answers", group.answers},
                            {"median_m", nullptr}};
    if (group.error_3d.median) entry["median_m"] = *group.error_3d.median;
    // The one number that status and batch show: our own answers against a reference that shares nothing with them,
    // else against the run's own tags, else the first there is; never the more flattering where there is a better one.
    const bool independent = group.group.kind == "absolute" && !group.group.shares_evidence;
    const int rank = independent ? 3 : group.group.reference == "self" ? 2 : 1;
    if (group.error_3d.median && group.group.variant == variant && group.group.method != "g1" && rank > best) {
      best = rank;
      (*metrics)["median_m"] = *group.error_3d.median;
      (*metrics)["median_against"] = group.group.reference + ", " + group.group.kind;
    }
    groups.push_back(std::move(entry));
  }
  (*metrics)["groups"] = groups;
}

void EvaluateProject(const EvaluateStageOptions& options, const std::string& variant, StageContext& context) {
  EvaluateInput input;
  input.stations = context.project.site().stations;
  std::erase_if(input.stations, [&](const Station& s) { return context.project.review().ExcludesStation(s.name); });
  input.references = ReferencesFor(context.project, options.reference, context.progress);
  EvaluationExtras extras;
  input.measured_stations =
      UseMeasuredOffsets(context.project, options.offsets, variant, &input.stations, &extras.notes);
  input.runs = ReadEvaluatedRuns(options, variant, input.stations, context, &extras.notes);
  EvaluatedSite site;
  for (const std::string& each : EvaluatedVariants(context.project, variant)) {
    AddEvaluatedSite(each, input.stations, context, &site);
  }
  std::vector<EvaluatedRun> with_cameras = input.runs;
  with_cameras.insert(with_cameras.end(), site.cameras.begin(), site.cameras.end());
  const std::vector<EstimateReport> estimates =
      ScoreEstimates(context.project, options.estimates, with_cameras, context.progress);
  input.runs.insert(input.runs.end(), site.answers.begin(), site.answers.end());
  if (input.runs.empty() && estimates.empty()) {
    throw InputError("no run is localized; expected at least one result of `trigpoint localize`");
  }
  context.progress.Begin("errors and their intervals", 0);
  Evaluation evaluation;
  evaluation.options = options.errors;
  if (!input.runs.empty()) evaluation = Evaluate(input, options.errors);
  FillRotationErrors(context.project, input.runs, &evaluation);
  for (const std::string& warning : evaluation.warnings) context.progress.Log(LogLevel::kWarning, warning);
  extras.comparisons = CompareWithin(evaluation);
  if (!options.truth.empty()) ScoreTruth(options, with_cameras, context, &extras.notes);
  if (!estimates.empty()) {
    WriteEstimates(estimates, context.out / "estimates.csv");
    const nlohmann::json json = {
        {"schema", "trigpoint estimates 1"}, {"unit", "m"}, {"estimates", EstimatesJson(estimates)}};
    WriteFileAtomically(context.out / "estimates.json", json.dump(2) + "\n");
    for (const EstimateReport& report : estimates) {
      context.metrics["estimates"].push_back(
          {{"system", report.system}, {"run", report.run}, {"rmse_m", *report.rmse_m}});
      for (const std::string& note : report.notes) {
        context.progress.Log(LogLevel::kWarning, report.system + " on " + report.run + ": " + note);
      }
    }
  }
  const std::vector<std::string> notes = extras.notes;
  const auto in_unit = [&](const DisplayUnit& unit) {
    extras.notes = notes;
    if (!estimates.empty()) extras.notes.push_back(FormatEstimates(estimates, unit.name, unit.metres));
  };
  TableOptions tables;
  tables.paper_tables = options.paper_tables;
  in_unit(tables.unit);
  WriteEvaluation(evaluation, context.out, tables, extras);
  // The same tables for people who read other units; every other file stays in metres.
  for (const char* unit : {"ft", "us-ft"}) {
    tables.unit = DisplayUnitNamed(unit);
    in_unit(tables.unit);
    WriteFileAtomically(context.out / fmt::format("tables_{}.md", unit), FormatEvaluation(evaluation, tables, extras));
  }
  SetMetrics(evaluation, variant, &context.metrics);
  context.metrics["runs"] = input.runs.size();
}

}  // namespace

StageInfo EvaluateStage() {
  StageInfo info;
  info.name = "evaluate";
  info.help = "compare localized panoramas with tags and control points: tables of errors";
  info.per_run = false;
  info.variants = true;
  info.needs = {"localize", "site", "detect", "survey", "reference"};
  info.reviewed = {"image", "detection", "tag", "station", "control"};
  info.metric = "median_m";
  info.flags = {"reference",
                "offsets",
                "truth",
                "max-median=max_median_m",
                "max-p90=max_p90_m",
                "min-answered=min_answered",
                "paper-tables=paper_tables"};
  UseOptions<EvaluateStageOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const auto options = ResolveOptions<EvaluateStageOptions>(project, "evaluate", target);
    StageRequest request;
    request.version = 15;
    request.options = JsonFromOptions(options);
    for (const char* table : {"stations.csv", "tags.yaml", "control_points.csv"}) {
      request.inputs.push_back(project.dir() / table);
    }
    for (const Run* run : EvaluatedRuns(project)) {
      for (const std::string& variant : EvaluatedVariants(project, target.variant)) {
        const StageTarget localized = TargetOf(run->name, variant);
        request.inputs.push_back(ManifestOf(project, "localize", localized));
        const std::string name = ResultName(StageNamed("localize"), localized);
        if (ReadFailure(project, "localize", name)) request.values["failed"].push_back(name);
      }
      request.inputs.push_back(ManifestOf(project, "detect", TargetOf(run->name, target.variant)));
      request.values["runs"].push_back(run->name);
      request.values["levelled"].push_back(run->config.odometry_levelled);
    }
    for (const std::string& variant : EvaluatedVariants(project, target.variant)) {
      const fs::path site = ManifestOf(project, "site", TargetOf("", variant));
      if (fs::exists(site)) request.inputs.push_back(site);
    }
    if (options.reference.empty() || options.reference.starts_with("survey")) {
      request.inputs.push_back(ReferenceMapFolder(project, options.reference.empty() ? "survey" : options.reference) /
                               "manifest.json");
    } else if (options.reference != "self" && options.reference != "control") {
      request.inputs.push_back(ReleaseFolder(project, options.reference));  // all of it: it must be as published
    }
    if (options.offsets != "stated")
      request.inputs.push_back(ManifestOf(project, "survey", TargetOf("", target.variant)));
    if (!options.truth.empty()) request.inputs.push_back(options.truth);
    for (const fs::path& input : EstimateInputs(project)) request.inputs.push_back(input);
    if (project.has_frame()) {
      const Geodetic& origin = project.frame().origin();
      request.values["origin"] = {origin.latitude_deg, origin.longitude_deg, origin.height_m};
    }
    request.body = [options, variant = target.variant](StageContext& context) {
      EvaluateProject(options, variant, context);
    };
    return request;
  };
  info.not_needed = [](const Project& project, const StageTarget&) -> std::string {
    if (project.site().stations.empty() && EstimateInputs(project).empty()) return "no stations.csv";
    if (EvaluatedRuns(project).empty()) return "no run whose role is evaluation or both";
    return "";
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit& unit) {
    const fs::path tables = outcome.dir / (unit.name == "m" ? "tables.md" : "tables_" + unit.name + ".md");
    return ReadTextFile(tables) + "Tables: " + (outcome.dir / "tables.md").string() + "\n";
  };
  return info;
}

}  // namespace trigpoint
