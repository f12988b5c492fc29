// The map of the tags that were seen so far, and the accuracy that it promises, for SiteCheck of check.h.
#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"
#include "eval/intake/check.h"
#include "eval/plan/layout.h"

namespace trigpoint {
namespace {

// `used` pictures of the tags, with the sigmas that the map found.
std::vector<PlannedSight> SightsSeen(const SurveyInput& input, const SurveyResult& map, size_t run,
                                     const PlannedPass& pass, double extra_sigma_px) {
  const auto frame_at = [&](int64_t stamp_ns) {
    const auto it = std::lower_bound(pass.world_from_body.begin(), pass.world_from_body.end(), stamp_ns,
                                     [](const TimedPose& p, int64_t s) { return p.stamp_ns < s; });
    return it != pass.world_from_body.end() && it->stamp_ns == stamp_ns
               ? static_cast<int>(it - pass.world_from_body.begin())
               : -1;
  };
  std::set<std::tuple<int64_t, int, int>> used;
  for (const SightResidual& sight : map.sights) {
    if (sight.used && sight.run == static_cast<int>(run)) used.insert({sight.stamp_ns, sight.camera, sight.tag_id});
  }
  std::vector<PlannedSight> sights;
  const SurveyRun& its = input.runs[run];
  for (const ImageDetections& image : its.images) {
    const auto camera = std::find_if(its.cameras.begin(), its.cameras.end(),
                                     [&](const BodyCamera& c) { return c.name == image.camera; });
    const auto c = static_cast<int>(camera == its.cameras.end() ? 0 : camera - its.cameras.begin());
    const int64_t stamp = BodyStamp(image.stamp_ns, its.cameras[static_cast<size_t>(c)]);
    const int frame = frame_at(stamp);
    for (const TagDetection& d : image.detections) {
      if (frame < 0 || !used.contains({stamp, c, d.id})) continue;
      PlannedSight sight{0, frame, c, d.id};
      sight.detection = d;
      sight.side_px = 1e9;
      for (size_t k = 0; k < 4; ++k) {
        sight.side_px = std::min(sight.side_px, (d.corners[k] - d.corners[(k + 1) % 4]).norm());
        // The factor counts for both parts of the sigma; the prediction adds the second one itself.
        const double whole = pass.corner_factor * std::hypot(d.corner_sigma_px[k], extra_sigma_px);
        sight.detection.corner_sigma_px[k] = std::sqrt(std::max(1e-6, whole * whole - extra_sigma_px * extra_sigma_px));
      }
      sights.push_back(std::move(sight));
    }
  }
  return sights;
}

// Does the camera fit the tags' squares? A map that may change the camera shows it.
void FindCalibrations(const SurveyInput& input, const SurveyOptions& options, int threads, const CancelToken& cancel,
                      FieldFacts* facts) {
  for (const RunAgreement& run : facts->map->runs) {
    if (run.sights > 0) facts->calibrations.push_back({run.name, run.rms_px, run.corner_factor});
  }
  SurveyOptions free = options;
  free.self_calibrate = true;
  ProgressSink silent;
  try {
    const SurveyResult map = SurveyTags(input, free, threads, silent, cancel);
    for (FieldCalibration& c : facts->calibrations) {
      for (size_t r = 0; r < map.runs.size(); ++r) {
        if (map.runs[r].name != c.run || !map.runs[r].camera) continue;
        c.focal_change = std::log(map.runs[r].camera->params()[0] / input.runs[r].cameras.front().camera.params()[0]);
        c.focal_sigma = map.runs[r].camera_sigma[0];
      }
    }
  } catch (const Cancelled&) {
    throw;
  } catch (const Error&) {  // too little is seen for it
  }
}

}  // namespace

// Of tags with a size, by runs with a camera.
SeenTags SiteCheck::TagsOf(const FieldFacts& facts) const {
  SeenTags tags;
  for (const FieldRun& run : facts.runs) {
    if (run.IsMisread()) continue;  // a map would blame what is right for it
    std::vector<ImageDetections>& its = tags[run.run->name];
    for (const FieldPicture& picture : run.pictures) {
      const auto c = static_cast<size_t>(picture.camera);
      ImageDetections image{picture.stamp_ns, picture.image,
                            c < run.run->cameras.size() ? run.run->cameras[c].name : "cam0", picture.tags};
      std::erase_if(image.detections, [&](const TagDetection& d) { return !(project_->site().tags.SizeOf(d.id) > 0); });
      if (!image.detections.empty()) its.push_back(std::move(image));
    }
    if (its.empty() || run.run->cameras.empty()) tags.erase(run.run->name);
  }
  return tags;
}

std::optional<MapInput> SiteCheck::InputOf(SeenTags* tags, StageContext& context, FieldFacts* facts) const {
  try {
    return sources_.map_input(context, *tags);
  } catch (const InputError& e) {
    facts->map_problem = e.what();
  }
  // What is wrong with one run is no reason to judge none of the others.
  SeenTags usable;
  std::vector<std::string> unusable;
  for (const auto& [run, images] : *tags) {
    const SeenTags alone = {{run, images}};
    try {
      sources_.map_input(context, alone);
      usable.insert({run, images});
    } catch (const InputError& e) {
      unusable.emplace_back(e.what());
    }
  }
  if (usable.empty() || unusable.empty()) return std::nullopt;
  *tags = std::move(usable);
  facts->map_problem.clear();
  for (const std::string& why : unusable) facts->unmapped.push_back(why);
  return sources_.map_input(context, *tags);
}

void SiteCheck::AddMap(FieldFacts* facts, ProgressSink& progress, const CancelToken& cancel) const {
  SeenTags tags = TagsOf(*facts);
  if (tags.empty()) return;  // each tag is named as missing, or as one without a size
  const SurveyOptions options = sources_.map(*project_);
  nlohmann::json metrics;
  StageContext context{*project_, out_, threads_, seed_, progress, cancel, metrics};
  try {
    const std::optional<MapInput> made = InputOf(&tags, context, facts);
    if (!made) return;
    const SurveyInput& input = made->input;
    facts->map = SurveyTags(input, options, threads_, progress, cancel);
    facts->input = input;
    for (const std::string& warning : made->warnings) facts->map->warnings.push_back({warning, -1, ""});
    FindCalibrations(input, options, threads_, cancel, facts);
    PlanLayout layout = LayoutOfMap(*project_, input, *facts->map, sources_.network(*project_));
    for (PlannedPass& pass : layout.network.passes) {
      for (size_t r = 0; r < input.runs.size(); ++r) {
        if (input.runs[r].name == pass.name) {
          pass.seen = SightsSeen(input, *facts->map, r, pass, layout.noise.extra_sigma_px);
        }
      }
    }
    facts->layout = layout.network;
    facts->prediction = PredictNetwork(layout.network, layout.noise, seed_, threads_, cancel);
  } catch (const Cancelled&) {
    throw;
  } catch (const OptionError&) {
    throw;
  } catch (const Error& e) {
    facts->map_problem = e.what();
  }
}

}  // namespace trigpoint
