#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "calib/base/counted.h"
#include "calib/geo/geodetic.h"
#include "survey/field/findings.h"
#include "survey/tags/map_start.h"

namespace trigpoint {
namespace {

constexpr double kLoop_m = 15;         // way between two traversals past a tag that makes them a loop
constexpr double kLoopWanted_m = 40;   // shorter runs need none
constexpr int kLoopShared = 25;        // features that pictures of two traversals share
constexpr int kFewPictures = 4;        // of a tag
constexpr double kNarrow_deg = 20;     // directions from which a tag is seen
constexpr double kPoorCorners = 4;     // residuals in sigmas of the corners
constexpr double kFocalOff = 0.004;    // share of the focal length that is worth a calibration
constexpr double kPoorOdometry = 6;    // residuals in units of what odometry is taken to be good for
constexpr double kClockKnown_s = 0.5;  // 1 sigma beyond which an offset says nothing
constexpr double kCovered = 0.9;       // share of the pictures that odometry covers
constexpr double kStation_m = 12;      // pictures that count as being at a station
constexpr int kStationPictures = 5, kStationSectors = 3;
constexpr double kSector_deg = 30;

// Way along a run, m, at each of its odometry's poses.
struct Way {
  explicit Way(const Trajectory& odometry) : poses(odometry.poses) {
    for (size_t k = 0; k < poses.size(); ++k) {
      const double step =
          k == 0 ? 0 : (poses[k].target_from_body.translation - poses[k - 1].target_from_body.translation).norm();
      length.push_back((k == 0 ? 0 : length.back()) + step);
    }
  }
  double At(int64_t stamp_ns) const {
    const auto it = std::lower_bound(poses.begin(), poses.end(), stamp_ns,
                                     [](const TimedPose& p, int64_t s) { return p.stamp_ns < s; });
    return it == poses.end() ? length.back() : length[static_cast<size_t>(it - poses.begin())];
  }
  const std::vector<TimedPose>& poses;
  std::vector<double> length;
};

void FindInTags(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  std::map<int, std::string> reasons;
  for (const TagEstimate& tag : facts.map->tags) reasons[tag.tag_id] = tag.reason;
  for (const TagCoverage& tag : CoverTags(facts)) {
    const bool planned = facts.planned.empty() || facts.planned.contains(tag.tag_id);
    if (tag.pictures == 0 || !planned) continue;
    const std::string reason = reasons[tag.tag_id].empty() ? "" : ": " + reasons[tag.tag_id];
    const auto add = [&](Light light, const std::string& text) {
      findings->push_back({light, "tags", fmt::format("tag {} {}", tag.tag_id, text)});
    };
    if (tag.status == "duplicate") {
      add(Light::kRed, "stands at two places" + reason + "; take one down and photograph the other again");
    } else if (tag.status == "moved") {
      add(Light::kRed, "moved" + reason + "; fix it and photograph it again, with its neighbours");
    } else if (tag.status == "not tied" || tag.status == "unsolved") {
      add(Light::kRed, "is seen and has no place in the map" + reason + "; photograph it together with others");
    } else if (tag.status == "ambiguous") {
      add(Light::kAmber, "has two possible poses; photograph it from nearer and from the side");
    } else if (tag.pictures < kFewPictures) {
      add(Light::kAmber, fmt::format("is in {} only; photograph it again", Counted(tag.pictures, "picture")));
    } else if (tag.SpanDeg() < kNarrow_deg) {
      add(Light::kAmber, fmt::format("is seen from one direction only ({:.0f} deg apart); photograph it from the side",
                                     tag.SpanDeg()));
    }
  }
}

// What the map warns of. Tags are named one by one already, and one that moved or stands twice takes surveyed points
// with it: their residuals are its consequences until it is mended.
void FindInWarnings(const SurveyResult& map, std::vector<SiteFinding>* findings) {
  std::set<int> wrong;
  std::vector<std::string> causes;
  std::vector<LengthText> follow;
  for (const TagEstimate& tag : map.tags) {
    if (tag.status != "moved" && tag.status != "duplicate") continue;
    wrong.insert(tag.tag_id);
    causes.push_back(std::to_string(tag.tag_id));
  }
  for (const MapWarning& warning : map.warnings) {
    if (wrong.contains(warning.tag_id)) continue;
    if (warning.point.empty()) {
      findings->push_back({Light::kAmber, "map", warning.text});
      continue;
    }
    for (const PointAgreement& point : map.points) {  // one that is not among them has an unseen tag, named elsewhere
      if (point.name != warning.point) continue;
      if (wrong.empty()) {
        findings->push_back({Light::kAmber, "map", warning.text});
      } else if (!wrong.contains(point.tag_id)) {
        follow.push_back(fmt::format("{} point {} is ", RoleName(point.role), point.name) +
                         Length{point.error_m.norm(), 3});
      }
    }
  }
  if (follow.empty()) return;
  findings->push_back(
      {Light::kAmber, "map",
       SomeOf(follow) + fmt::format(" off the map, which may follow from {} {}: mend that first, then check again",
                                    causes.size() == 1 ? "tag" : "tags", SomeOf(causes))});
}

// A map that fewer than three control points hold is no better than the geotags beside them.
void FindInDatum(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  constexpr size_t kLeastControl = 3;
  size_t given = 0, used = 0;
  std::vector<std::string> unseen;
  const std::set<int> seen = TagsSeen(facts);
  for (const SurveyPoint& point : facts.input->points) {
    if (point.role != PointRole::kControl) continue;
    ++given;
    if (point.tag_id >= 0 && !seen.contains(point.tag_id)) unseen.push_back(point.name);
  }
  for (const PointAgreement& point : facts.map->points) {
    used += point.role == PointRole::kControl && point.used && !point.excluded ? 1 : 0;
  }
  if (given == 0 || used >= kLeastControl) return;
  const std::string held = fmt::format("{} of {} {} the map, three are needed to fix it", used,
                                       Counted(given, "control point"), used == 1 ? "holds" : "hold");
  if (!unseen.empty()) {
    const bool one = unseen.size() == 1;
    findings->push_back(
        {Light::kAmber, "datum",
         fmt::format("{}: no picture shows the {} of control {} {}; photograph {}", held, one ? "tag" : "tags",
                     one ? "point" : "points", SomeOf(unseen, 8), one ? "it" : "them")});
  } else if (given < kLeastControl) {
    findings->push_back(
        {Light::kAmber, "datum",
         fmt::format("{}; measure {} more, not on one line with the others", held, kLeastControl - given)});
  }
}

void FindInCalibration(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  for (const FieldCalibration& c : facts.calibrations) {
    const double sigmas = c.focal_sigma > 0 ? std::abs(c.focal_change) / c.focal_sigma : 0;
    // A wrong size of all tags looks like another focal length.
    if (std::abs(c.focal_change) > kFocalOff && sigmas > 3 && !facts.map->common_size) {
      findings->push_back(
          {Light::kAmber, "calibration",
           fmt::format("{}: the calibration does not fit: by the tags' squares the focal length is {:+.1f} % off "
                       "({:.0f} sigma); was the zoom or the focus moved? Photograph the board before leaving",
                       c.run, 100 * std::expm1(c.focal_change), sigmas)});
    } else if (c.corner_factor > kPoorCorners) {
      findings->push_back(
          {Light::kAmber, "calibration",
           fmt::format("{}: the tags' squares are reprojected to {:.2f} px, {:.0f} times the sigma "
                       "of their corners; check the calibration, the tags' sizes and that they are flat",
                       c.run, c.rms_px, c.corner_factor)});
    } else {
      findings->push_back({Light::kGreen, "calibration",
                           fmt::format("{}: the tags' squares are reprojected to {:.2f} px (rms)", c.run, c.rms_px)});
    }
  }
}

void FindInClock(const FieldRun& run, std::vector<SiteFinding>* findings) {
  if (!run.clock) return;
  const FieldClock& clock = *run.clock;
  const auto add = [&](Light light, const std::string& text) {
    findings->push_back({light, "clock", run.run->name + ": " + text});
  };
  if (clock.significant) {
    add(Light::kRed,
        fmt::format("odometry's clock is {:+.2f} s off the pictures' (1 sigma {:.2f} s): write odometry: "
                    "{{time_offset_s: {:.2f}}} into run.yaml, or record again",
                    -clock.offset_s, clock.sigma_s, run.run->config.odometry_time_offset_s + clock.offset_s));
  } else if (clock.agrees && clock.sigma_s < kClockKnown_s) {
    add(Light::kGreen, fmt::format("odometry's clock agrees with the pictures' ({:+.2f} s, 1 sigma {:.2f} s)",
                                   -clock.offset_s, clock.sigma_s));
  } else if (!clock.agrees) {
    add(Light::kGreen,
        fmt::format("the pictures' rotations do not show whether odometry's clock agrees with theirs (an offset of "
                    "{:+.2f} s fits better than none, but not clearly)",
                    -clock.offset_s));
  }
}

void FindInOdometry(const FieldFacts& facts, const FieldRun& run, std::vector<SiteFinding>* findings) {
  const std::string& name = run.run->name;
  const auto add = [&](Light light, const char* topic, const std::string& text) {
    findings->push_back({light, topic, name + ": " + text});
  };
  if (!run.unit_problem.empty()) add(Light::kRed, "odometry", run.unit_problem);
  if (run.run->odometry.poses.empty()) {
    if (!run.pictures.empty()) add(Light::kAmber, "odometry", "no odometry; is odometry.tum still to be copied?");
    return;
  }
  size_t covered = 0;
  for (const FieldPicture& picture : run.pictures) {
    constexpr int64_t kGap_ns = 2'000'000'000;
    covered += run.run->odometry.At(picture.stamp_ns, kGap_ns) ? 1 : 0;
  }
  if (static_cast<double>(covered) < kCovered * static_cast<double>(run.pictures.size())) {
    add(Light::kRed, "odometry",
        fmt::format("odometry covers {} of {} pictures; check both clocks, or copy all of it", covered,
                    run.pictures.size()));
  }
  if (!run.reading_problem.empty()) add(Light::kRed, "odometry", run.reading_problem);
  if (run.IsMisread()) return;
  FindInClock(run, findings);
  if (!facts.map) return;
  for (const RunAgreement& found : facts.map->runs) {
    if (found.name != name) continue;
    const double scale = std::abs(found.scale - 1);
    if (scale > 3 * run.run->config.odometry_scale_sigma && scale > 3 * found.scale_sigma) {
      add(Light::kAmber, "odometry",
          fmt::format("true lengths, by the tags, are {:.3f} times those of odometry, which scale_sigma {:g} does not "
                      "allow; check the tags' sizes and odometry's unit",
                      found.scale, run.run->config.odometry_scale_sigma));
    }
    if (!found.jumps_ns.empty()) {
      add(Light::kAmber, "odometry",
          fmt::format("odometry jumped {}, first at {} s; pass that stretch again",
                      found.jumps_ns.size() == 1 ? "once" : fmt::format("{} times", found.jumps_ns.size()),
                      FormatNsAsSeconds(found.jumps_ns.front(), 1)));
    }
    const double factor = found.odometry_factor.maxCoeff();
    if (factor > kPoorOdometry) {
      add(Light::kAmber, "odometry",
          fmt::format(
              "odometry and tags differ by {:.0f} times the sigma of odometry; check the body's axes, the order of the "
              "quaternion, the clock, and whether wheels slipped",
              factor));
    } else {
      add(Light::kGreen, "odometry",
          fmt::format("odometry agrees with the tags; true lengths, by them, are {:.3f} times those of odometry (1 "
                      "sigma {:.3f})",
                      found.scale, found.scale_sigma));
    }
  }
}

void FindInGps(const FieldRun& run, std::vector<SiteFinding>* findings) {
  if (run.pictures.empty()) return;
  const std::string& name = run.run->name;
  if (run.run->gps.empty()) {
    findings->push_back({Light::kGreen, "gps", name + ": no GPS"});
    return;
  }
  const int64_t first = run.pictures.front().stamp_ns, last = run.pictures.back().stamp_ns;
  constexpr int64_t kSlack_ns = 5'000'000'000;
  const auto within = std::count_if(run.run->gps.begin(), run.run->gps.end(), [&](const GpsFix& fix) {
    return fix.stamp_ns > first - kSlack_ns && fix.stamp_ns < last + kSlack_ns;
  });
  if (within > 0) {
    findings->push_back(
        {Light::kGreen, "gps", fmt::format("{}: {} GPS fixes at the time of its pictures", name, within)});
  } else {
    findings->push_back({Light::kAmber, "gps",
                         name + ": none of its GPS fixes was taken while it recorded; check time_zero_utc and "
                                "gps: time_offset_s in run.yaml"});
  }
}

// A site that is localized by panoramas, photos or GPS alone has no tags, and misses none.
bool HasTags(const FieldFacts& facts) {
  const auto shows_tags = [](const FieldRun& run) {
    return std::any_of(run.pictures.begin(), run.pictures.end(), [](const FieldPicture& p) { return !p.tags.empty(); });
  };
  return facts.site->tags.Given() || !facts.planned.empty() ||
         std::any_of(facts.runs.begin(), facts.runs.end(), shows_tags);
}

int GeotagsOf(const Site& site) {
  return static_cast<int>(std::count_if(site.references.begin(), site.references.end(),
                                        [](const Reference& r) { return r.geotag.has_position; }));
}

int TagsSharedWithOthers(const FieldFacts& facts, const FieldRun& run) {
  std::set<int> own, shared;
  for (const FieldPicture& picture : run.pictures) {
    for (const TagDetection& tag : picture.tags) own.insert(tag.id);
  }
  for (const FieldRun& other : facts.runs) {
    if (&other == &run) continue;
    for (const FieldPicture& picture : other.pictures) {
      for (const TagDetection& tag : picture.tags) {
        if (own.contains(tag.id)) shared.insert(tag.id);
      }
    }
  }
  return static_cast<int>(shared.size());
}

LengthText ClosedLoopText(const LoopCoverage& loop) {
  std::vector<LengthText> how;
  if (loop.returns > 0) {
    how.push_back(fmt::format("it came back to tags ({}, the last after ",
                              loop.returns == 1 ? "once" : fmt::format("{} times", loop.returns)) +
                  Length{loop.last_return_m} + ")");
  }
  if (loop.pictures_again > 0) {
    how.push_back(fmt::format("{} show places that were passed before", Counted(loop.pictures_again, "picture")));
  }
  return "loop closed: " + SomeOf(how);
}

void FindLoop(const FieldFacts& facts, const FieldRun& run, std::vector<SiteFinding>* findings) {
  const std::optional<LoopCoverage> loop = CoverLoop(facts, run);
  if (!loop) return;
  const auto add = [&](Light light, const LengthText& text) {
    findings->push_back({light, "loops", run.run->name + ": " + LengthText(Length{loop->length_m}) + ", " + text});
  };
  const bool tagged = HasTags(facts);
  const std::string others =
      loop->shared_tags > 0 ? fmt::format("; it shares {} with other runs", Counted(loop->shared_tags, "tag")) : "";
  if (loop->returns > 0 || loop->pictures_again > 0) {
    add(Light::kGreen, ClosedLoopText(*loop) + others);
  } else if (loop->open && tagged) {
    add(Light::kAmber,
        "without coming back to a tag: the loop is open" + others + "; pass the first tags again at the end");
  } else if (loop->open) {
    add(Light::kAmber,
        "without coming back to a place that was passed before: the loop is open; pass the beginning again at the end");
  } else if (loop->length_m > kLoopWanted_m && tagged) {
    add(Light::kGreen, fmt::format("held by {} that other runs share; it needs no loop of its own",
                                   Counted(loop->shared_tags, "tag")));
  } else if (loop->length_m > kLoopWanted_m) {
    const int geotags = GeotagsOf(*facts.site);
    add(Light::kGreen, fmt::format("the loop is open, but {} along the way {} the drift of odometry",
                                   geotags > 0 ? Counted(geotags, "geotag") : "GPS", geotags > 1 ? "limit" : "limits"));
  }
}

void FindInStations(const FieldFacts& facts, std::vector<SiteFinding>* findings) {
  std::vector<std::string> bare;
  for (const StationCoverage& station : CoverStations(facts, kStation_m)) {
    if (!station.reference) bare.push_back(station.station);
    const std::string name = "station " + station.station;
    if (station.pictures < kStationPictures) {
      findings->push_back({Light::kAmber, "stations",
                           name + ": " + Counted(station.pictures, "picture") + " within " +
                               LengthText(Length{kStation_m}) + "; pass it again"});
    } else if (station.sectors < kStationSectors) {
      findings->push_back(
          {Light::kAmber, "stations",
           fmt::format("{}: pictures from one side only ({} of 12 sectors); walk past it", name, station.sectors)});
    }
  }
  if (!bare.empty()) {
    findings->push_back({Light::kAmber, "stations",
                         fmt::format("no panorama, photo or photo set yet of {} {}",
                                     bare.size() == 1 ? "station" : "stations", SomeOf(bare, 8))});
  }
}

}  // namespace

std::optional<LoopCoverage> CoverLoop(const FieldFacts& facts, const FieldRun& run) {
  constexpr int kHoldingTags = 2;
  if (run.run->odometry.poses.size() < 2 || run.pictures.empty()) return std::nullopt;
  const Way way(run.run->odometry);
  LoopCoverage loop;
  std::map<int, double> last_seen;
  for (const FieldPicture& picture : run.pictures) {
    const double at = way.At(picture.stamp_ns);
    for (const TagDetection& tag : picture.tags) {
      const auto [it, fresh] = last_seen.try_emplace(tag.id, at);
      if (!fresh && at - it->second > kLoop_m) ++loop.returns, loop.last_return_m = at;
      it->second = at;
    }
  }
  loop.length_m = way.At(run.pictures.back().stamp_ns) - way.At(run.pictures.front().stamp_ns);
  loop.shared_tags = TagsSharedWithOthers(facts, run);
  loop.pictures_again = static_cast<int>(std::count_if(run.pairs.begin(), run.pairs.end(), [](const FieldPair& pair) {
    return pair.loop && pair.shared >= kLoopShared;
  }));
  const bool held =
      HasTags(facts) ? loop.shared_tags >= kHoldingTags : GeotagsOf(*facts.site) > 0 || !run.run->gps.empty();
  loop.open = loop.length_m > kLoopWanted_m && loop.returns == 0 && loop.pictures_again == 0 && !held;
  return loop;
}

std::set<int> TagsSeen(const FieldFacts& facts) {
  std::set<int> seen;
  for (const FieldRun& run : facts.runs) {
    for (const FieldPicture& picture : run.pictures) {
      for (const TagDetection& d : picture.tags) seen.insert(d.id);
    }
  }
  return seen;
}

std::vector<TagCoverage> CoverTags(const FieldFacts& facts) {
  std::map<int, TagCoverage> tags;
  for (const auto& [id, planned] : facts.planned) tags[id];
  std::map<int, std::set<const FieldRun*>> runs;
  for (const FieldRun& run : facts.runs) {
    for (const FieldPicture& picture : run.pictures) {
      for (const TagDetection& d : picture.tags) {
        TagCoverage& tag = tags[d.id];
        ++tag.pictures;
        runs[d.id].insert(&run);
        for (size_t k = 0; k < 4; ++k) {
          tag.largest_px = std::max(tag.largest_px, (d.corners[k] - d.corners[(k + 1) % 4]).norm());
        }
      }
    }
  }
  std::map<int, Rigid3d> poses;
  if (facts.map) {
    for (const TagEstimate& tag : facts.map->tags) {
      tags[tag.tag_id].status = tag.HasPose() ? tag.status : "unsolved";
      if (tag.HasPose()) poses[tag.tag_id] = *tag.world_from_tag;
    }
    std::set<int> begun;
    for (const SightResidual& sight : facts.map->sights) {
      if (!sight.used || !poses.contains(sight.tag_id)) continue;
      const auto& bodies = facts.map->runs[static_cast<size_t>(sight.run)].world_from_body;
      const auto body = std::lower_bound(bodies.begin(), bodies.end(), sight.stamp_ns,
                                         [](const TimedPose& p, int64_t s) { return p.stamp_ns < s; });
      if (body == bodies.end() || body->stamp_ns != sight.stamp_ns) continue;
      const BodyCamera& camera =
          facts.input->runs[static_cast<size_t>(sight.run)].cameras[static_cast<size_t>(sight.camera)];
      // x to the right as one faces the tag, z into it.
      const Eigen::Vector3d at =
          poses.at(sight.tag_id).Inverse() * (body->target_from_body * camera.cam_from_body.Inverse()).translation;
      const double angle = std::atan2(at.x(), -at.z()) * kRadToDeg;
      TagCoverage& tag = tags[sight.tag_id];
      const bool fresh = begun.insert(sight.tag_id).second;
      tag.left_deg = fresh ? angle : std::min(tag.left_deg, angle);
      tag.right_deg = fresh ? angle : std::max(tag.right_deg, angle);
      tag.nearest_m = std::min(tag.nearest_m.value_or(at.norm()), at.norm());
    }
  }
  if (facts.prediction) {
    for (const TagPrediction& tag : facts.prediction->tags) {
      if (tag.tied) tags[tag.tag_id].sigma_m = tag.Sigma();
      if (!tag.tied && tags[tag.tag_id].status == "ok") tags[tag.tag_id].status = "not tied";
    }
  }
  std::vector<TagCoverage> list;
  for (auto& [id, tag] : tags) {
    tag.tag_id = id;
    tag.runs = static_cast<int>(runs[id].size());
    if (tag.pictures == 0) tag.status = "not seen";
    list.push_back(tag);
  }
  return list;
}

std::vector<StationCoverage> CoverStations(const FieldFacts& facts, double radius_m) {
  std::vector<StationCoverage> list;
  if (!facts.layout) return list;
  for (const Station& station : facts.site->stations) {
    const auto tag = facts.layout->world_from_tag.find(station.tag_id);
    if (tag == facts.layout->world_from_tag.end()) continue;
    const Eigen::Vector3d centre = tag->second.translation + OffsetInWorld(station, tag->second);
    StationCoverage coverage;
    coverage.station = station.name;
    coverage.nearest_m = 1e9;
    std::set<int> sectors;
    for (const PlannedPass& pass : facts.layout->passes) {
      for (const TimedPose& body : pass.world_from_body) {
        const Eigen::Vector3d away = body.target_from_body.translation - centre;
        coverage.nearest_m = std::min(coverage.nearest_m, away.norm());
        if (away.norm() > radius_m) continue;
        ++coverage.pictures;
        sectors.insert(static_cast<int>(std::floor(std::atan2(away.y(), away.x()) * kRadToDeg / kSector_deg)));
      }
    }
    coverage.sectors = static_cast<int>(sectors.size());
    coverage.reference = facts.referenced.contains(station.name);
    list.push_back(coverage);
  }
  return list;
}

std::vector<SiteFinding> FindInMap(const FieldFacts& facts) {
  std::vector<SiteFinding> findings;
  if (!facts.map_problem.empty()) findings.push_back({Light::kRed, "map", facts.map_problem});
  for (const std::string& why : facts.unmapped) {
    findings.push_back({Light::kRed, "map", "one run takes no part in the map: " + why});
  }
  if (!facts.map && facts.map_problem.empty() && !HasTags(facts)) {
    findings.push_back({Light::kGreen, "map", "no tags: neither tags.yaml nor a plan nor a picture has one"});
  } else if (!facts.map && facts.map_problem.empty()) {
    const bool unread =
        std::any_of(facts.runs.begin(), facts.runs.end(), [](const FieldRun& run) { return run.IsMisread(); });
    findings.push_back({Light::kAmber, "map",
                        unread ? "there is no tag map until the odometry is mended"
                               : "there is no tag map yet: no tag with a size is in any picture of a run "
                                 "with a camera"});
  }
  if (facts.map) {
    FindInTags(facts, &findings);
    FindInWarnings(*facts.map, &findings);
    FindInDatum(facts, &findings);
    FindInCalibration(facts, &findings);
    FindInStations(facts, &findings);
  }
  for (const FieldRun& run : facts.runs) {
    FindInOdometry(facts, run, &findings);
    FindInGps(run, &findings);
    FindLoop(facts, run, &findings);
  }
  return findings;
}

}  // namespace trigpoint
