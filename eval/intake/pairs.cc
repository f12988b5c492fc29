#include "eval/intake/pairs.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/parallel.h"
#include "calib/geo/geodetic.h"
#include "calib/geometry/bearing.h"
#include "calib/geometry/pose_readings.h"
#include "datasets/io/camchain.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"

namespace trigpoint {
namespace {

constexpr double kKeyframe_m = 0.5, kKeyframe_deg = 10, kKeyframe_s = 0.4;  // from one keyframe to the next
// Of an earlier traversal: as `reconstruct` looks for loops, with room for odometry's drift.
constexpr double kLoop_m = 30, kNear_m = 3, kDrift = 0.03, kAxis_deg = 40, kSpacing_m = 3;

struct Keyframe {
  const FieldPicture* picture = nullptr;
  std::optional<Rigid3d> odom_from_cam;
  double way_m = 0;
};

std::vector<Keyframe> KeyframesOf(const FieldRun& run, int camera) {
  constexpr int64_t kGap_ns = 2'000'000'000;
  std::vector<Keyframe> keyframes;
  std::optional<Eigen::Vector3d> last;
  double way = 0;
  for (const FieldPicture& picture : run.pictures) {
    if (picture.camera != camera || !picture.problem.empty() || !picture.quality) continue;
    Keyframe next{&picture};
    const BodyCamera& its = run.run->cameras[static_cast<size_t>(camera)];
    if (const auto odom_from_body = run.run->odometry.At(picture.stamp_ns, kGap_ns)) {
      next.odom_from_cam = *odom_from_body * its.cam_from_body.Inverse();
      if (last) way += (next.odom_from_cam->translation - *last).norm();
      last = next.odom_from_cam->translation;
    }
    next.way_m = way;
    if (!keyframes.empty()) {
      const Keyframe& before = keyframes.back();
      const bool posed = next.odom_from_cam && before.odom_from_cam;
      const double turn = posed ? before.odom_from_cam->rotation.angularDistance(next.odom_from_cam->rotation) : 0;
      const bool moved = next.way_m - before.way_m >= kKeyframe_m || turn >= kKeyframe_deg * kDegToRad;
      const double seconds = 1e-9 * static_cast<double>(picture.stamp_ns - before.picture->stamp_ns);
      if (posed ? !moved : seconds < kKeyframe_s) continue;
    }
    keyframes.push_back(next);
  }
  return keyframes;
}

std::string VersionsOf(const FieldPicture& a, const FieldPicture& b) { return a.version + ", " + b.version; }

// The nearest keyframe of an earlier traversal that looks the same way.
const Keyframe* Earlier(const std::vector<Keyframe>& keyframes, size_t k) {
  const Keyframe& now = keyframes[k];
  const Keyframe* nearest = nullptr;
  double least = 1e9;
  for (size_t j = 0; j < k && now.odom_from_cam; ++j) {
    const Keyframe& other = keyframes[j];
    const double between = now.way_m - other.way_m;
    if (between < kLoop_m) break;
    if (!other.odom_from_cam) continue;
    const double away = (other.odom_from_cam->translation - now.odom_from_cam->translation).norm();
    const double angle = AngleBetween(other.odom_from_cam->rotation * Eigen::Vector3d::UnitZ(),
                                      now.odom_from_cam->rotation * Eigen::Vector3d::UnitZ());
    if (away > kNear_m + kDrift * between || angle > kAxis_deg * kDegToRad || away >= least) continue;
    least = away;
    nearest = &other;
  }
  return nearest;
}

}  // namespace

PairLog::PairLog(const std::filesystem::path& file) : lines_(file, {{"schema", 5}, {"features", 1}}) { Read(); }

void PairLog::Read() {
  lines_.Read([&](const nlohmann::json& j) {
    SharedView view;
    view.features = j.at("shared");
    view.matches = j.at("matches");
    if (!j.at("turn").is_null()) {
      const std::array<double, 4> q = j.at("turn");
      view.b_from_a = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
    }
    if (!j.at("direction").is_null()) {
      const std::array<double, 3> way = j.at("direction");
      view.direction = Eigen::Vector3d(way[0], way[1], way[2]).normalized();
      view.sigma_direction_rad = j.at("sigma_direction");
    }
    shared_[{j.at("run"), j.at("a"), j.at("b")}] = {j.at("versions"), view};
  });
}

const SharedView* PairLog::Find(const std::string& run, const FieldPicture& a, const FieldPicture& b) const {
  const auto it = shared_.find({run, a.image, b.image});
  return it == shared_.end() || it->second.first != VersionsOf(a, b) ? nullptr : &it->second.second;
}

std::vector<FieldPair> PairsOf(const FieldRun& run, const PairLog& log) {
  std::vector<FieldPair> pairs;
  for (size_t c = 0; c < run.run->cameras.size(); ++c) {
    const std::vector<Keyframe> keyframes = KeyframesOf(run, static_cast<int>(c));
    double tried = -1e9;
    const auto add = [&](const Keyframe& a, const Keyframe& b, bool loop) {
      const SharedView* shared = log.Find(run.run->name, *a.picture, *b.picture);
      pairs.push_back({a.picture->image, b.picture->image, shared != nullptr ? shared->features : -1, loop, b.way_m,
                       shared != nullptr ? shared->matches : 0});
    };
    for (size_t k = 1; k < keyframes.size(); ++k) {
      add(keyframes[k - 1], keyframes[k], false);
      if (keyframes[k].way_m - tried < kSpacing_m) continue;
      if (const Keyframe* earlier = Earlier(keyframes, k)) {
        tried = keyframes[k].way_m;
        add(*earlier, keyframes[k], true);
      }
    }
  }
  return pairs;
}

std::vector<MeasuredTurn> TurnsOf(const FieldRun& run, const PairLog& log) {
  std::map<std::string, const FieldPicture*> seen;
  for (const FieldPicture& picture : run.pictures) seen[picture.image] = &picture;
  std::vector<MeasuredTurn> turns;
  for (const FieldPair& pair : PairsOf(run, log)) {
    if (pair.loop) continue;
    const FieldPicture &a = *seen.at(pair.from), &b = *seen.at(pair.to);
    const SharedView* shared = log.Find(run.run->name, a, b);
    if (shared == nullptr || !shared->b_from_a) continue;
    const BodyCamera& camera = run.run->cameras[static_cast<size_t>(a.camera)];
    const auto stamp = [&](const FieldPicture& p) { return BodyStamp(p.stamp_ns, camera); };
    turns.push_back({stamp(a), stamp(b), camera.cam_from_body.rotation, *shared->b_from_a, shared->direction,
                     shared->sigma_direction_rad});
  }
  return turns;
}

std::optional<std::string> FindOtherReading(const Run& run, const std::vector<MeasuredTurn>& turns,
                                            const std::string& odometry) {
  constexpr int64_t kGap_ns = 2'000'000'000;
  constexpr double kSigma_rad = 0.5 * kDegToRad;  // of a turn by the features of shrunk pictures
  std::vector<Rigid3d> poses;
  std::vector<MeasuredMotion> motions;
  for (const MeasuredTurn& turn : turns) {
    const auto a = run.odometry.At(turn.a_ns, kGap_ns), b = run.odometry.At(turn.b_ns, kGap_ns);
    if (!a || !b) continue;
    MeasuredMotion motion;
    motion.a = static_cast<int>(poses.size()), motion.b = motion.a + 1;
    motion.sensor_from_body.rotation = turn.sensor_from_body;
    motion.b_from_a.rotation = turn.b_from_a;
    motion.sigma_rotation_rad = kSigma_rad;
    motion.has_direction = turn.direction.has_value();
    motion.b_from_a.translation = turn.direction.value_or(Eigen::Vector3d::Zero());
    motion.sigma_direction_rad = turn.sigma_direction_rad;
    poses.insert(poses.end(), {*a, *b});
    motions.push_back(motion);
  }
  const ReadingVerdict verdict = JudgeReadings(poses, motions, PoseReadings());
  if (verdict.kind != ReadingVerdict::Kind::kContradicted || verdict.better.empty()) return std::nullopt;
  const auto counts = [](const MotionAgreement& m) {
    return fmt::format("{} of {} turns and {} of {} directions", m.turns_agree, m.turns, m.directions_agree,
                       m.directions);
  };
  return fmt::format("{} contradicts the pictures: as read, it agrees with {} between pictures", odometry,
                     counts(verdict.as_read)) +
         BetterReadings(verdict, counts(verdict.best));
}

size_t ComparePairs(const FieldRun& run, size_t most, PairLog* log, int threads, ProgressSink& progress,
                    const CancelToken& cancel) {
  std::vector<FieldPair> pairs = PairsOf(run, *log);
  std::erase_if(pairs, [](const FieldPair& pair) { return pair.shared >= 0; });
  pairs.resize(std::min(most, pairs.size()));
  if (pairs.empty()) return 0;
  std::map<std::string, const ImageEntry*> entries;
  for (const ImageEntry& image : run.run->images) entries[image.file] = &image;
  std::map<std::string, const FieldPicture*> seen;
  for (const FieldPicture& picture : run.pictures) seen[picture.image] = &picture;
  std::map<std::string, QuickFeatures> features;
  for (const FieldPair& pair : pairs) {
    features.try_emplace(pair.from);
    features.try_emplace(pair.to);
  }
  std::vector<std::pair<const std::string, QuickFeatures>*> pictures;
  for (auto& its : features) pictures.push_back(&its);
  const SharedFeatureOptions options;
  const RunMasks masks(*run.run);
  progress.Begin("features of " + run.run->name, static_cast<int64_t>(pictures.size()));
  ParallelFor(static_cast<int64_t>(pictures.size()), threads, cancel, [&](int64_t i) {
    auto& [file, found] = *pictures[static_cast<size_t>(i)];
    const ImageEntry& entry = *entries.at(file);
    try {
      const Camera& camera = run.run->cameras[static_cast<size_t>(entry.camera)].camera;
      found = FindQuickFeatures(LoadGrey(*run.run, entry), masks.Of(entry), camera, options);
    } catch (const InputError&) {  // it was readable a moment ago: without features it shares nothing
    }
    progress.Advance(1);
  });
  JsonAppender appender(log->file());
  ParallelFor(static_cast<int64_t>(pairs.size()), threads, cancel, [&](int64_t i) {
    const FieldPair& pair = pairs[static_cast<size_t>(i)];
    const SharedView shared = CompareViews(features.at(pair.from), features.at(pair.to), options);
    const auto turn = [&] {
      const Eigen::Vector4d& q = shared.b_from_a->coeffs();
      return nlohmann::json{q.x(), q.y(), q.z(), q.w()};
    };
    const auto direction = [&] {
      return nlohmann::json{shared.direction->x(), shared.direction->y(), shared.direction->z()};
    };
    appender.Add({{"run", run.run->name},
                  {"a", pair.from},
                  {"b", pair.to},
                  {"versions", VersionsOf(*seen.at(pair.from), *seen.at(pair.to))},
                  {"shared", shared.features},
                  {"matches", shared.matches},
                  {"turn", shared.b_from_a ? turn() : nlohmann::json()},
                  {"direction", shared.direction ? direction() : nlohmann::json()},
                  {"sigma_direction", shared.sigma_direction_rad}});
  });
  log->Read();
  return pairs.size();
}

}  // namespace trigpoint
