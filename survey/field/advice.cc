#include "survey/field/advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/base/median.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {
namespace {

constexpr size_t kWeakest = 6;                                 // tags for which walks are tried
constexpr double kSizes = 8, kNearest_m = 2, kFarthest_m = 6;  // distance from which a tag is photographed
constexpr double kLookFrom_m = 3, kLookTo_m = 5;               // of a tag that is in no picture yet
constexpr double kSide_deg = 50;                // between its normal and the line of sight, from the side
constexpr double kStep_m = 0.7, kStep_s = 0.5;  // of a walk
constexpr int kShots = 4;                       // pictures of each tag at the ends of a walk
constexpr double kFront_deg = 15;               // as good as straight in front
constexpr double kLeastGain = 0.005;            // share of the RMS that is worth a walk

Eigen::Vector3d LevelNormal(const Rigid3d& world_from_tag) {
  Eigen::Vector3d normal = -(world_from_tag.rotation * Eigen::Vector3d::UnitZ());
  normal.z() = 0;
  return normal.norm() > 1e-6 ? Eigen::Vector3d(normal.normalized()) : Eigen::Vector3d::UnitX();
}

// `angle` to the right of the tag's normal as one faces it.
Eigen::Vector3d Before(const Rigid3d& world_from_tag, double angle_deg, double distance, double height) {
  const Eigen::AngleAxisd turn(angle_deg * kDegToRad, Eigen::Vector3d::UnitZ());
  Eigen::Vector3d at = world_from_tag.translation + distance * (turn * LevelNormal(world_from_tag));
  at.z() = height;
  return at;
}

// The body whose camera stands at `from` and looks at `at`, level.
Rigid3d BodyLooking(const BodyCamera& camera, const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
  Eigen::Vector3d forward = at - from;
  forward.z() = 0;
  if (forward.norm() < 1e-6) forward = Eigen::Vector3d::UnitX();
  Eigen::Matrix3d columns;
  columns.col(2) = forward.normalized();
  columns.col(1) = -Eigen::Vector3d::UnitZ();
  columns.col(0) = columns.col(1).cross(columns.col(2));
  return Rigid3d(Eigen::Quaterniond(columns), from) * camera.cam_from_body;
}

// Pictures of one tag, a walk, pictures of the other.
PlannedPass Walk(const PlannedPass& like, const Rigid3d& first, const Eigen::Vector3d& first_from, const Rigid3d& last,
                 const Eigen::Vector3d& last_from) {
  PlannedPass pass = like;
  pass.name = "walk";
  pass.date = like.date + " walk";
  pass.seen.reset();
  pass.world_from_body.clear();
  const BodyCamera& camera = pass.cameras.front();
  const auto add = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
    const auto stamp = static_cast<int64_t>(1e9 * kStep_s * static_cast<double>(pass.world_from_body.size()));
    pass.world_from_body.push_back({stamp, BodyLooking(camera, from, at)});
  };
  const Eigen::Vector3d way = last_from - first_from;
  const Eigen::Vector3d aside = 0.3 * Eigen::Vector3d(-way.y(), way.x(), 0).normalized();
  for (int k = 0; k < kShots; ++k) add(first_from + (k - 1.5) * aside, first.translation);
  const int steps = static_cast<int>(way.norm() / kStep_m);
  for (int k = 1; k < steps; ++k) add(first_from + static_cast<double>(k) / steps * way, last.translation);
  for (int k = 0; k < kShots; ++k) add(last_from + (k - 1.5) * aside, last.translation);
  return pass;
}

class Adviser {
 public:
  Adviser(const FieldFacts& facts, const NetworkOptions& options, uint64_t seed, int threads, const CancelToken& cancel)
      : facts_(facts), options_(options), tags_(CoverTags(facts)), seed_(seed), threads_(threads), cancel_(cancel) {
    options_.ties_per_image = 0;  // walks are compared with each other: tags and odometry rank them
  }

  std::vector<Advice> Missing() const {
    std::vector<Advice> list;
    for (const TagCoverage& tag : tags_) {
      if (tag.pictures == 0) list.push_back(MissingTag(tag.tag_id));
    }
    for (const FieldSet& set : facts_.sets) {
      if (set.full_turn || !set.problem.empty()) continue;
      list.push_back(
          {fmt::format("Photo set {}: go on turning on the spot{}, half a picture at a time, until the ring "
                       "is closed",
                       set.name,
                       set.before_gap.empty() ? "" : fmt::format(" from {} to {}", set.before_gap, set.after_gap)),
           WhyOpen(set)});
    }
    for (const TagCoverage& tag : tags_) {
      if (tag.pictures == 0 || (!facts_.planned.empty() && !facts_.planned.contains(tag.tag_id))) continue;
      const char* what = tag.status == "duplicate" ? "stands at two places: take one down, then photograph the other"
                         : tag.status == "moved"   ? "moved: fix it, then photograph it with its neighbours"
                         : tag.status == "not tied"
                             ? "shares no picture or path with others: walk from it to another tag while recording"
                             : nullptr;
      if (what == nullptr) continue;
      Advice advice{fmt::format("Tag {} {}", tag.tag_id, what), "its place is not known"};
      if (const auto pose = Pose(tag.tag_id)) advice.at = pose->translation;
      list.push_back(advice);
    }
    for (Advice& advice : OfRuns()) list.push_back(std::move(advice));
    if (!facts_.map) return list;
    for (const MoveOrJump& u : facts_.map->undecided) {
      Advice advice{fmt::format("Tag {}: photograph it from one spot together with its neighbours", u.tag_id),
                    "it moved, or odometry jumped beside it"};
      if (const auto pose = Pose(u.tag_id)) advice.at = pose->translation;
      list.push_back(advice);
    }
    return list;
  }

  std::vector<Advice> Walks() const {
    std::vector<Advice> list;
    if (!facts_.layout || !facts_.prediction || facts_.layout->passes.empty()) return list;
    std::vector<const TagCoverage*> tied;
    for (const TagCoverage& tag : tags_) {
      if (tag.sigma_m && Pose(tag.tag_id)) tied.push_back(&tag);
    }
    if (tied.size() < 2) return list;
    std::sort(tied.begin(), tied.end(),
              [](const TagCoverage* a, const TagCoverage* b) { return a->sigma_m->norm() > b->sigma_m->norm(); });
    const NetworkPrediction before = PredictNetwork(*facts_.layout, options_, seed_, threads_, cancel_);
    for (size_t k = 0; k < std::min(kWeakest, tied.size()); ++k) {
      const Advice advice = WalkTo(*tied[k], tied, before);
      if (advice.rms_after_m < (1 - kLeastGain) * before.RmsSigma()) list.push_back(advice);
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const Advice& a, const Advice& b) { return a.rms_after_m < b.rms_after_m; });
    return list;
  }

 private:
  std::optional<Rigid3d> Pose(int tag_id) const {
    if (!facts_.layout) return std::nullopt;
    const auto it = facts_.layout->world_from_tag.find(tag_id);
    return it == facts_.layout->world_from_tag.end() ? std::nullopt : std::optional<Rigid3d>(it->second);
  }
  bool InWorld() const { return facts_.prediction && facts_.prediction->in_world; }

  // Stretches on which pictures in a row do not hang together, the weakest first, and loops that are open.
  std::vector<Advice> OfRuns() const {
    std::vector<std::pair<int, Advice>> gaps;
    std::vector<Advice> list;
    for (const FieldRun& run : facts_.runs) {
      std::string from, to;
      int least = kLeastSharedInARow;
      const auto end_gap = [&] {
        if (from.empty()) return;
        gaps.emplace_back(
            least,
            Advice{fmt::format("Run {}: record the way from picture {} to {} again, slowly and without turning "
                               "on the spot",
                               run.run->name, from, to),
                   fmt::format("pictures in a row share {} features there, {} are needed", least, kLeastSharedInARow)});
        from.clear(), least = kLeastSharedInARow;
      };
      for (const FieldPair& pair : run.pairs) {
        if (pair.loop || pair.shared < 0) continue;
        if (pair.shared >= kLeastSharedInARow || pair.from != to) end_gap();
        if (pair.shared >= kLeastSharedInARow) continue;
        if (from.empty()) from = pair.from;
        to = pair.to, least = std::min(least, pair.shared);
      }
      end_gap();
    }
    std::stable_sort(gaps.begin(), gaps.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [shared, advice] : gaps) list.push_back(std::move(advice));
    for (const FieldRun& run : facts_.runs) {
      const auto loop = CoverLoop(facts_, run);
      if (!loop || !loop->open) continue;
      list.push_back({fmt::format("Run {}: go on to where it began (picture {}) while recording, and pass the "
                                  "beginning again",
                                  run.run->name, run.pictures.front().image),
                      "its loop is open: the drift of odometry is not known"});
    }
    return list;
  }

  // As surveyed or planned, else by the geotag of its station's panorama, m, world.
  std::optional<Eigen::Vector3d> PlaceOf(int tag_id) const {
    if (const auto& planned = facts_.planned.at(tag_id).world_m) return planned;
    if (!facts_.input) return std::nullopt;
    for (const SurveyPoint& point : facts_.input->points) {
      if (point.tag_id != tag_id) continue;
      // The direction of an offset in the frame of a tag is not known before the tag is: it is short.
      return point.offset_in_tag_frame ? point.world_m : Eigen::Vector3d(point.world_m - point.offset_m);
    }
    return std::nullopt;
  }

  Advice MissingTag(int tag_id) const {
    const PlannedTag& planned = facts_.planned.at(tag_id);
    const std::string what = planned.what.empty() ? "" : " (" + planned.what + ")";
    Advice advice{fmt::format("Photograph tag {}{}", tag_id, what), "it is in no picture"};
    advice.at = InWorld() ? PlaceOf(tag_id) : std::nullopt;
    if (advice.at) {
      // Where it is, by the nearest tag that was found.
      double nearest = 1e9;
      LengthText where;
      for (const auto& [id, pose] : facts_.layout->world_from_tag) {
        const Eigen::Vector3d away = *advice.at - pose.translation;
        if (id == tag_id || away.norm() >= nearest) continue;
        nearest = away.norm();
        where = ", " + LengthText(Length{nearest}) +
                fmt::format(" {} of tag {}", CompassText(std::atan2(away.x(), away.y())), id);
      }
      advice.what += where;
    }
    advice.what += ", from " + LengthText(Length{kLookFrom_m, 0, false}) + " to " + Length{kLookTo_m} +
                   " and from two sides, coming from a tag that was seen";
    return advice;
  }

  double Distance(int tag_id) const {
    return std::clamp(kSizes * facts_.layout->sizes.SizeOf(tag_id), kNearest_m, kFarthest_m);
  }

  // Height of the cameras.
  double Height() const {
    std::vector<double> heights;
    for (const PlannedPass& pass : facts_.layout->passes) {
      for (const TimedPose& body : pass.world_from_body) {
        heights.push_back((body.target_from_body * pass.cameras.front().cam_from_body.Inverse()).translation.z());
      }
    }
    return Median(std::move(heights));
  }

  // The side from which it was not seen yet.
  static double FreeSide(const TagCoverage& tag) {
    double best = 0, farthest = -1;
    for (const double side : {-kSide_deg, 0.0, kSide_deg}) {
      const double off = side < tag.left_deg ? tag.left_deg - side : side > tag.right_deg ? side - tag.right_deg : 0;
      if (off > farthest) best = side, farthest = off;
    }
    return best;
  }

  Advice WalkTo(const TagCoverage& tag, const std::vector<const TagCoverage*>& tied,
                const NetworkPrediction& before) const {
    const Rigid3d pose = *Pose(tag.tag_id);
    // From the best known of its nearest neighbours.
    std::vector<const TagCoverage*> near = tied;
    std::erase(near, &tag);
    std::sort(near.begin(), near.end(), [&](const TagCoverage* a, const TagCoverage* b) {
      return (Pose(a->tag_id)->translation - pose.translation).norm() <
             (Pose(b->tag_id)->translation - pose.translation).norm();
    });
    constexpr size_t kNeighbours = 3;
    near.resize(std::min(kNeighbours, near.size()));
    const TagCoverage& start = **std::min_element(
        near.begin(), near.end(), [](const auto* a, const auto* b) { return a->sigma_m->norm() < b->sigma_m->norm(); });
    const double height = Height(), side = FreeSide(tag);
    const Eigen::Vector3d from = Before(pose, side, Distance(tag.tag_id), height);
    const Rigid3d start_pose = *Pose(start.tag_id);
    NetworkLayout layout = *facts_.layout;
    layout.passes.push_back(Walk(layout.passes.front(), start_pose,
                                 Before(start_pose, FreeSide(start), Distance(start.tag_id), height), pose, from));
    const NetworkPrediction after = PredictNetwork(layout, options_, seed_, threads_, cancel_);
    Advice advice;
    advice.from = from;
    advice.at = pose.translation;
    const Eigen::Vector3d line = pose.translation - from;
    advice.heading_rad = std::atan2(line.x(), line.y());
    advice.rms_after_m = after.RmsSigmaOf(before);
    const std::string where = std::abs(side) < kFront_deg ? "straight in front of it"
                              : side < 0                  ? "to the left of it as you face it"
                                                          : "to the right of it as you face it";
    advice.what = fmt::format("Photograph tag {} from ", tag.tag_id) + Length{Distance(tag.tag_id)} +
                  fmt::format(", {}{}; record on the way there from tag {}", where,
                              InWorld() ? ", looking " + CompassText(*advice.heading_rad) : "", start.tag_id);
    advice.why = fmt::format("without scene points the tags' RMS sigma falls from {:.1f} to {:.1f} mm",
                             1e3 * before.RmsSigma(), 1e3 * advice.rms_after_m);
    return advice;
  }

  const FieldFacts& facts_;
  NetworkOptions options_;
  std::vector<TagCoverage> tags_;
  uint64_t seed_;
  int threads_;
  const CancelToken& cancel_;
};

}  // namespace

std::string CompassText(double heading_rad) {
  static constexpr std::array<const char*, 8> kNames = {"north", "north-east", "east", "south-east",
                                                        "south", "south-west", "west", "north-west"};
  const double deg = std::fmod(heading_rad * kRadToDeg + 720, 360);
  const auto k = static_cast<size_t>(std::lround(deg / 45)) % kNames.size();
  return fmt::format("{} ({:.0f} deg)", kNames[k], deg);
}

std::string NothingNext(const FieldFacts& facts, bool green) {
  if (!green) return "No further picture is needed by itself; the findings say what to do.";
  return facts.prediction ? "No further picture would improve the predicted accuracy much."
                          : "Nothing is missing. Without a tag map no accuracy is predicted.";
}

std::vector<Advice> WhatNext(const FieldFacts& facts, const NetworkOptions& options, size_t count, uint64_t seed,
                             int threads, const CancelToken& cancel) {
  const Adviser adviser(facts, options, seed, threads, cancel);
  std::vector<Advice> list = adviser.Missing();
  if (list.size() < count) {
    for (Advice& advice : adviser.Walks()) list.push_back(std::move(advice));
  }
  list.resize(std::min(count, list.size()));
  return list;
}

}  // namespace trigpoint
