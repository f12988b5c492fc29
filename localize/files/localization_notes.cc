#include "localize/files/localization_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "calib/base/counted.h"
#include "calib/base/median.h"
#include "datasets/io/capture_date.h"
#include "datasets/io/credits.h"
#include "datasets/io/source_quality.h"
#include "datasets/io/time_check.h"
#include "localize/files/tables.h"

namespace trigpoint {
namespace {

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
      text += fmt::format("{} are too few to estimate their sigma; the stated {:.2f} m is used", e.positions,
                          e.stated_sigma_m);
    }
    const bool bad = AtLeast(e.outliers, e.positions, expected) < kUnlikely;
    text +=
        fmt::format("; {} of {} contradict the run; estimated share of wrong positions {:.0f} %, expected {:.0f} %{}",
                    e.outliers, e.positions, 100 * share, 100 * expected, bad ? "; check them" : "");
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
      {"gps", CheckGpsTime(r)}, {"odometry", CheckOdometryTime(r, FirstCameraTrajectory(job.input, result))}};
  for (const auto& [sensor, offset] : clocks) {
    if (!offset.observable) continue;
    context->metrics["time_offsets"][sensor] = {{"offset_s", offset.offset_s}, {"sigma_s", offset.sigma_s}};
    if (offset.warning) context->progress.Log(LogLevel::kWarning, *offset.warning);
  }
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

}  // namespace

void LeaveOutSets(Site* site, ProgressSink& progress) {
  const auto of_set = [](const Reference& r) { return r.kind == ReferenceKind::kPhotoSet; };
  if (std::all_of(site->references.begin(), site->references.end(), of_set)) return;
  if (std::erase_if(site->references, of_set) > 0) {
    progress.Log(LogLevel::kInfo, "paper mode: the photo sets are left out, as published references are panoramas");
  }
}

void NoteLocalization(const Site& site, const Run& run, const LocalizeJob& job, const std::vector<SetRefinement>& sets,
                      const SolutionCounts& counts, Localization* result, StageContext& context) {
  WarnOfEarth(job, result, context.progress);
  NoteSources(*result, &context);
  ExplainByDate(site, run, job, result);
  context.metrics.update(Metrics(job, counts, *result));
  NoteClocks(run, job, *result, &context);
  NoteFocals(job, result->photo_focals, &context);
  NoteRigs(sets, &context.metrics);
}

}  // namespace trigpoint
