#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <set>

#include "app/pipeline/drawn_views.h"
#include "app/pipeline/image_motion.h"
#include "app/pipeline/localize_files.h"
#include "app/pipeline/reconstruct_stage.h"
#include "app/pipeline/set_localization.h"
#include "app/pipeline/stage_list.h"
#include "app/pipeline/world_evidence.h"
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
#include "localize/reconstruct/kept_features.h"
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

// What a reader needs to judge whether a run has the size it should have.
std::string SizeOfRun(const Localization& result) {
  double way = 0;
  for (size_t k = 1; k < result.body_from_odom.size(); ++k) {
    way +=
        (result.body_from_odom[k].TargetOriginInSource() - result.body_from_odom[k - 1].TargetOriginInSource()).norm();
  }
  std::vector<double> depths;
  for (size_t k = 0; k < result.reconstruction.depth_m.size(); ++k) {
    if (result.reconstruction.point_valid[k]) depths.push_back(result.reconstruction.depth_m[k]);
  }
  return fmt::format("the run is {:.3g} m long, and its scene points lie {:.3g} m from the cameras in the median", way,
                     Median(std::move(depths)));
}

nlohmann::json Metrics(const LocalizeJob& job, const SolutionCounts& counts, const Localization& result) {
  nlohmann::json m;
  int localized = 0, rejected = 0, unmatched = 0;
  for (const ReferenceAnswer& a : result.references) {
    ++(a.registration.status == AnswerStatus::kLocalized  ? localized
       : a.registration.status == AnswerStatus::kRejected ? rejected
                                                          : unmatched);
  }
  m["images"] = job.input.images.size();
  m["images_without_odometry"] = job.without_odometry;
  m["has_odometry"] = job.input.has_odometry;
  m["references"] = result.references.size();
  m["localized"] = localized;
  m["rejected"] = rejected;
  m["unmatched"] = unmatched;
  if (job.input.has_odometry && localized == 0) m["size"] = SizeOfRun(result);
  for (const auto& [name, count] : counts) {
    if (name == "tracks" || name == "observations") m[name] = static_cast<int64_t>(count);
  }
  m["feature_sigma_px"] = result.reconstruction.sigma_px;
  for (double f : result.reconstruction.odometry_noise_factor) m["odometry_noise_factor_rx_ry_rz_x_y_z"].push_back(f);
  m["on_earth"] = result.on_earth;
  m["earth_source"] = result.earth_source;
  m["earth_reason"] = result.earth_reason;
  m["odometry_scale"] = result.odometry_scale;
  m["odometry_scale_sigma"] = result.odometry_scale_sigma;
  m["retrieval_words"] = result.retrieval.words;
  m["retrieval_memory_mib"] = result.retrieval.memory_mib;
  if (result.world.frame >= 0) {
    m["world"] = {{"map_tags", result.world.map_tags},
                  {"control_tags", result.world.control_tags},
                  {"left_out", result.world.left_out},
                  {"gps", result.world.gps}};
  }
  for (const auto& [name, seconds] : result.seconds) m["seconds"][name] = seconds;
  return m;
}

// As published, references are panoramas. The photos of a hand-held set, each by itself, would take their places.
void LeaveOutSets(Site* site, ProgressSink& progress) {
  const auto of_set = [](const Reference& r) { return r.kind == ReferenceKind::kPhotoSet; };
  if (std::all_of(site->references.begin(), site->references.end(), of_set)) return;
  if (std::erase_if(site->references, of_set) > 0) {
    progress.Log(LogLevel::kInfo, "paper mode: the photo sets are left out, as published references are panoramas");
  }
}

// Why a run is not georeferenced depends on how much there is that could do it.
void CountGeotags(const LocalizeJob& job, Localization* result) {
  if (result->on_earth || result->earth_reason.empty()) return;
  int geotags = 0;
  for (size_t i = 0; i < result->references.size(); ++i) {
    geotags += result->references[i].pose >= 0 && job.input.references[i].geotag.has_position ? 1 : 0;
  }
  result->earth_reason += fmt::format(
      "; of {} panoramas and photos {} are localized and have a geotag, and {} GPS fixes lie at the images' times",
      result->references.size(), geotags, job.gps.size());
}

void WarnOfEarth(const LocalizeJob& job, Localization* localization, ProgressSink& progress) {
  CountGeotags(job, localization);
  const Localization& result = *localization;
  if (!result.earth_reason.empty()) {
    progress.Log(LogLevel::kWarning, (result.on_earth ? "" : "not georeferenced: ") + result.earth_reason);
  }
  // Half of it: a height that one of many GPS fixes has is known.
  if (result.on_earth && std::sqrt(result.geo.covariance(5, 5)) > 0.5 * kUnknownHeightSigma)
    progress.Log(LogLevel::kWarning,
                 "no geotag has a height: the references are taken to lie at the height of the site's origin, "
                 "so heights are unknown (1 sigma 10 km)");
}

// P(at least k of n), each with probability p.
double AtLeast(int k, int n, double p) {
  double below = 0, term = std::pow(1 - p, n);
  for (int i = 0; i < k; ++i) {
    below += term;
    term *= p / (1 - p) * (n - i) / (i + 1);
  }
  return 1 - below;
}

// What the run shows of the sources of its geotags, against what is expected of them.
void NoteSources(const Localization& result, StageContext* context) {
  constexpr double kPriorCount = 10;  // positions that the expected share of wrong ones counts as
  constexpr double kUnlikely = 0.01;
  for (const SourceEstimate& e : result.geo.sources) {
    const double expected = QualityOfSource(e.source)->outlier_share;
    const double share = (e.outliers + kPriorCount * expected) / (e.positions + kPriorCount);
    std::string text = fmt::format("positions of {}: ", e.source);
    if (e.sigma_m > 0) {
      text += fmt::format("1 sigma {:.2f} +- {:.2f} m per axis, estimated from {} (stated: {:.2f} m)", e.sigma_m,
                          e.relative_sigma * e.sigma_m, e.positions, e.stated_sigma_m);
    } else {
      text += fmt::format("{} are too few to estimate their sigma; {:.2f} m is taken as stated", e.positions,
                          e.stated_sigma_m);
    }
    text += fmt::format("; {} of {} wrong, a share of {:.0f} % with the {:.0f} % that are expected", e.outliers,
                        e.positions, 100 * share, 100 * expected);
    const bool bad = AtLeast(e.outliers, e.positions, expected) < kUnlikely;
    context->progress.Log(bad ? LogLevel::kWarning : LogLevel::kInfo, text);
    context->metrics["sources"][e.source] = {{"positions", e.positions},       {"outliers", e.outliers},
                                             {"outlier_share", share},         {"stated_sigma_m", e.stated_sigma_m},
                                             {"estimated_sigma_m", e.sigma_m}, {"relative_sigma", e.relative_sigma}};
  }
}

// Pictures of other years and seasons show another scene: a reason why there is no answer.
void ExplainByDate(const Site& site, const Run& run, const LocalizeJob& job, Localization* result) {
  const std::map<std::string, PictureCredit> credits = ReadCredits(site.dir);
  const std::string date = DateOfRun(run);
  for (size_t i = 0; i < job.references.size(); ++i) {
    Registration& g = result->references[i].registration;
    const auto credit = credits.find(site.references[static_cast<size_t>(job.references[i].reference)].name);
    if (g.status == AnswerStatus::kLocalized || credit == credits.end()) continue;
    const std::string gap = ExplainGap(credit->second.captured_at, date);
    if (!gap.empty()) g.reason += (g.reason.empty() ? "" : "; ") + gap;
  }
}

// Offsets of other clocks against the images'.
void NoteClocks(const Run& r, const LocalizeJob& job, const Localization& result, StageContext* context) {
  const std::pair<const char*, TimeOffset> clocks[] = {
      {"gps", CheckGpsTime(r)}, {"odometry", CheckOdometryTime(r, FirstCameraTrajectory(job, result))}};
  for (const auto& [sensor, offset] : clocks) {
    if (!offset.observable) continue;
    context->metrics["time_offsets"][sensor] = {{"offset_s", offset.offset_s}, {"sigma_s", offset.sigma_s}};
    if (offset.warning) context->progress.Log(LogLevel::kWarning, *offset.warning);
  }
}

// Without odometry the length of the run is first known once it is georeferenced. Thresholds in metres hold from then
// on, so it is localized again.
Localization AtItsLength(const LocalizeJob& job, const std::function<Localization(double length)>& localize) {
  constexpr int kRounds = 3;
  constexpr double kGoodEnough = 1.1;
  double length = 1;
  for (int round = 1;; ++round) {
    Localization result = localize(length);
    const bool known = std::abs(std::log(result.odometry_scale)) < std::log(kGoodEnough);
    if (job.input.has_odometry || !result.on_earth || known || round == kRounds) return result;
    length *= result.odometry_scale;
  }
}

// Names the rows of panoramas.csv that the references belong to.
void WriteWithTables(const Site& site, const LocalizeJob& job, Solution* solution, const std::filesystem::path& dir) {
  for (size_t i = 0; i < job.references.size(); ++i) {
    solution->references[i].row = site.references[static_cast<size_t>(job.references[i].reference)].name;
  }
  WriteSolution(*solution, dir / kSolutionFile);
  WriteCameraCovariances(*solution, dir);
  WritePanoramaCovariances(*solution, dir);
  WriteColmapModel(ModelOf(*solution).model, dir / "sparse");
}

// How long a run is, and how well that is known.
std::string LengthText(const nlohmann::json& metrics) {
  const double sigma = metrics.at("odometry_scale_sigma").get<double>();
  if (!metrics.value("has_odometry", true)) return fmt::format("length known to {:.1f} % (1 sigma)", 100 * sigma);
  return fmt::format("odometry scale {:.4f} +- {:.4f} (1 sigma)", metrics.at("odometry_scale").get<double>(), sigma);
}

void NoteFocals(const LocalizeJob& job, const std::vector<PhotoFocal>& focals, StageContext* context) {
  for (const PhotoFocal& focal : focals) {
    nlohmann::json photos;
    for (const size_t i : focal.references) photos.push_back(job.references[i].name);
    const double sigma = focal.factor * focal.sigma;
    context->progress.Log(
        LogLevel::kInfo,
        fmt::format(
            "focal length of {} ({}): {:.4f} (1 sigma {:.4f}) times what EXIF states, by {} observations of the "
            "run's points in {} of them",
            Counted(static_cast<int64_t>(photos.size()), "photo", "photos"), photos[0].get<std::string>(), focal.factor,
            sigma, focal.points, focal.photos));
    context->metrics["photo_focals"].push_back({{"photos", std::move(photos)},
                                                {"found_by_stated", focal.factor},
                                                {"sigma", sigma},
                                                {"photos_used", focal.photos},
                                                {"observations", focal.points}});
  }
}

void NoteRigs(const std::vector<SetRefinement>& sets, nlohmann::json* metrics) {
  for (const SetRefinement& set : sets) {
    (*metrics)["rigs"][set.name] = {{"freedom", RigFreedomName(set.freedom)},
                                    {"scale", set.rig.scale},
                                    {"scale_sigma", set.rig.scale_sigma},
                                    {"rms_px", set.rig.rms_px},
                                    {"hold_out_px_fixed_scaled_prior_free", set.hold_out}};
  }
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
    request.version = 27;
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
    AddWorldInputs(project, target, options.world, &request);
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
      const WorldSources world(context.project, target, options.world, job);
      std::vector<SetRefinement> sets;
      const auto refine = [&](const Reconstruction& reconstruction, const Retrieval& retrieval,
                              std::vector<ReferenceViews>* placed, std::vector<Registration>* answers) {
        sets = RefineSets(job, options.registration, options.rig, reconstruction, retrieval, context.seed,
                          context.progress, context.cancel, placed, answers);
      };
      SolutionCounts counts;
      Localization result = AtItsLength(job, [&](double length) {
        Solution alone = ReadReconstruction(context.project, "localize", target);
        counts = alone.counts;
        Reconstruction reconstruction = ReconstructionOf(job.input, std::move(alone));
        if (length != 1) ScaleReconstruction(length, &reconstruction);
        const WorldEvidence evidence =
            world.EvidenceFor(reconstruction, context.threads, context.progress, context.cancel);
        return Localize(job.input, std::move(reconstruction), job.gps, how, context.threads, context.seed,
                        context.progress, context.cancel, refine, evidence);
      });
      WarnOfEarth(job, &result, context.progress);
      NoteSources(result, &context);
      ExplainByDate(site, r, job, &result);
      WriteLocalization(site, job, result, context.out);
      WriteRigs(sets, result, context.out);
      context.metrics.update(Metrics(job, counts, result));
      NoteClocks(r, job, result, &context);
      NoteFocals(job, result.photo_focals, &context);
      NoteRigs(sets, &context.metrics);
      Solution solution = SolutionOf(job.input, r.name, options.mode, counts, &result);
      if (solution.georeference && result.world.frame >= 0) {
        solution.georeference->evidence = world.EvidenceOf(result.world);
        context.metrics["world"]["evidence"] = solution.georeference->evidence;
      }
      WriteWithTables(site, job, &solution, context.out);
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
