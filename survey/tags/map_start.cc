#include "survey/tags/map_start.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/base/error.h"
#include "calib/geometry/alignment.h"
#include "calib/geometry/nearest_to_rays.h"
#include "datasets/io/camchain.h"
#include "survey/tags/control.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kWaypoint_m = 1;    // longer ways between frames get poses of their own
constexpr double kStartGatePx = 40;  // odometry drifts between visits

Rigid3d BodyFromCam(const SurveyInput& input, const MapStart& start, const MapSight& s) {
  return input.runs[start.frames[s.frame].run].cameras[s.camera].cam_from_body.Inverse();
}

std::map<int, Rigid3d> TagsOf(const SurveyInput& input, const MapStart& start, int run, int threads,
                              const CancelToken& cancel) {
  TagPosesOptions options;
  options.gate_px = kStartGatePx;
  options.min_images = 1;
  options.min_side_px = 1;
  ProgressSink silent;
  std::map<int, Rigid3d> tags;
  for (const TagEstimate& tag :
       EstimateTagPoses(ViewsOf(input, start, run), input.sizes, options, threads, silent, cancel)) {
    if (tag.HasPose()) tags[tag.tag_id] = *tag.world_from_tag;
  }
  return tags;
}

// Body pose of a frame from the known tags it sees: the planar solution that explains most corners.
std::optional<Rigid3d> Resect(const SurveyInput& input, const MapStart& start, const MapFrame& frame,
                              const std::map<int, Rigid3d>& tags) {
  std::optional<Rigid3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (int i : frame.sights) {
    const MapSight& s = start.sights[i];
    const auto tag = tags.find(s.detection.id);
    if (tag == tags.end()) continue;
    for (const PlanarPose& pose : EstimatePlanarPoses(s.sight, input.sizes.SizeOf(s.detection.id))) {
      const Rigid3d world_from_body =
          tag->second * pose.cam_from_tag.Inverse() * BodyFromCam(input, start, s).Inverse();
      double cost = 0;
      for (int k : frame.sights) {
        const MapSight& other = start.sights[k];
        const auto known = tags.find(other.detection.id);
        if (known == tags.end()) continue;
        const Vector8d r = TagResidual(other.sight, input.sizes.SizeOf(other.detection.id),
                                       BodyFromCam(input, start, other).Inverse(), world_from_body, known->second);
        cost += std::min(ResidualPx(other.sight, r), kStartGatePx);
      }
      if (cost < best_cost) best_cost = cost, best = world_from_body;
    }
  }
  return best;
}

// A run without odometry: tags and frames in turn, outwards from one tag.
std::map<int, Rigid3d> Grow(const SurveyInput& input, int run, int threads, const CancelToken& cancel,
                            MapStart* start) {
  std::map<int, int> count;
  for (const MapSight& s : start->sights) {
    if (start->frames[s.frame].run == run) ++count[s.detection.id];
  }
  std::map<int, Rigid3d> tags;
  if (count.empty()) return tags;
  const auto most =
      std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  tags[most->first] = Rigid3d();
  for (size_t known = 0; known != tags.size();) {
    known = tags.size();
    cancel.ThrowIfCancelled();
    for (MapFrame& frame : start->frames) {
      if (frame.run == run) frame.world_from_body = Resect(input, *start, frame, tags);
    }
    for (const auto& [id, pose] : TagsOf(input, *start, run, threads, cancel)) tags.emplace(id, pose);
  }
  return tags;
}

// target_from_source from tags in both: the tag pose that brings most centres together, then all of those.
std::optional<Rigid3d> Join(const std::map<int, Rigid3d>& source, const std::map<int, Rigid3d>& target) {
  std::optional<Rigid3d> best;
  double best_score = 0;
  constexpr double kNear = 1.0;  // m
  for (const auto& [id, pose] : source) {
    const auto other = target.find(id);
    if (other == target.end()) continue;
    const Rigid3d t = other->second * pose.Inverse();
    double score = 0;
    for (const auto& [k, p] : source) {
      const auto q = target.find(k);
      if (q == target.end()) continue;
      const double d = (t * p.translation - q->second.translation).norm() / kNear;
      score += std::max(0.0, 1 - d * d);
    }
    if (score > best_score) best_score = score, best = t;
  }
  if (!best) return best;
  std::vector<Eigen::Vector3d> a, b;
  for (const auto& [k, p] : source) {
    const auto q = target.find(k);
    if (q == target.end() || (*best * p.translation - q->second.translation).norm() > kNear) continue;
    for (double x : {-0.5, 0.5}) {  // centres and a point beside each, so that two tags suffice
      a.push_back(p * Eigen::Vector3d(x, 0, 0));
      b.push_back(q->second * Eigen::Vector3d(x, 0, 0));
    }
  }
  if (a.size() >= 4) {
    const Sim3d fit = AlignPoints(a, b, AlignmentKind::kSE3);
    best = Rigid3d(fit.rotation, fit.translation);
  }
  return best;
}

// A surveyed point in the map and where it was surveyed; nothing if it is not in the map.
struct PointPair {
  Eigen::Vector3d map, world;
};
std::optional<PointPair> PairOf(const MapStart& start, const SurveyInput& input, const SurveyPoint& p) {
  // An offset in the tag's frame cannot be turned before the map is level.
  const Eigen::Vector3d world = p.offset_in_tag_frame ? p.world_m : Eigen::Vector3d(p.world_m - p.offset_m);
  const auto mark = start.marked.find(p.name);
  if (p.tag_id < 0 && mark != start.marked.end()) return PointPair{mark->second, world};
  const auto tag = start.world_from_tag.find(p.tag_id);
  if (tag == start.world_from_tag.end()) return std::nullopt;
  return PointPair{p.corner < 0 ? tag->second.translation
                                : Eigen::Vector3d(tag->second * TagCorner(input.sizes.SizeOf(p.tag_id), p.corner)),
                   world};
}

// world_from_map from points: every triple proposes, all judge by their sigmas.
std::optional<Rigid3d> JoinPoints(const MapStart& start, const SurveyInput& input,
                                  const std::vector<SurveyPoint>& points) {
  std::vector<Eigen::Vector3d> a, b;
  std::vector<double> sigma;
  for (const SurveyPoint& p : points) {
    const std::optional<PointPair> pair = PairOf(start, input, p);
    if (!pair) continue;
    a.push_back(pair->map);
    b.push_back(pair->world);
    // An offset in the tag's frame widens the tolerance.
    sigma.push_back(std::max(0.5, 3 * std::hypot(p.sigma_h_m, p.sigma_v_m)) +
                    (p.offset_in_tag_frame ? p.offset_m.norm() : 0));
  }
  const int n = static_cast<int>(std::min<size_t>(a.size(), 25));
  std::optional<Rigid3d> best;
  double best_score = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      for (int k = j + 1; k < n; ++k) {
        if (!IsTriangle(b[i], b[j], b[k])) continue;
        const Sim3d fit = AlignPoints({a[i], a[j], a[k]}, {b[i], b[j], b[k]}, AlignmentKind::kSE3);
        double score = 0;
        for (size_t m = 0; m < a.size(); ++m) score += std::exp(-(fit * a[m] - b[m]).norm() / sigma[m]);
        if (score > best_score) best_score = score, best = Rigid3d(fit.rotation, fit.translation);
      }
    }
  }
  return best;
}

// How far control lies from where the others have it, if all of it does so by the same: the others then hold the map's
// attitude, and control its place. A solution that began elsewhere would have to move the whole map.
Eigen::Vector3d CommonShift(const MapStart& start, const SurveyInput& input, const std::vector<SurveyPoint>& points,
                            const Rigid3d& world_from_map) {
  constexpr double kAgree = 0.25;  // of the shift
  std::vector<Eigen::Vector3d> shifts;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const SurveyPoint& p : points) {
    const std::optional<PointPair> pair = PairOf(start, input, p);
    if (!pair || p.role != PointRole::kControl) continue;
    shifts.emplace_back(pair->world - world_from_map * pair->map);
    mean += shifts.back();
  }
  if (shifts.size() < 2) return Eigen::Vector3d::Zero();
  mean /= static_cast<double>(shifts.size());
  for (const Eigen::Vector3d& shift : shifts) {
    if ((shift - mean).norm() > kAgree * mean.norm()) return Eigen::Vector3d::Zero();
  }
  return mean;
}

// Stamps of odometry between frames that are far apart, so that its errors add up along the way it took: a straight
// line from frame to frame would forget the loops between them.
std::set<int64_t> Waypoints(const Trajectory& odometry,
                            const std::map<int64_t, std::vector<const ImageDetections*>>& frames) {
  std::set<int64_t> waypoints;
  if (frames.empty()) return waypoints;
  auto next = frames.begin();
  std::optional<Eigen::Vector3d> last;
  for (const TimedPose& pose : odometry.poses) {
    if (pose.stamp_ns > frames.rbegin()->first) break;
    const Eigen::Vector3d& place = pose.target_from_body.translation;
    bool passed = false;
    for (; next != frames.end() && next->first <= pose.stamp_ns; ++next) passed = true;
    if (passed) last = place;
    if (!last || (place - *last).norm() < kWaypoint_m) continue;
    waypoints.insert(pose.stamp_ns);
    last = place;
  }
  return waypoints;
}

// Points of the input's marks, from their rays in the map's frame.
void PlaceMarks(const SurveyInput& input, MapStart* start) {
  for (const SurveyPoint& p : input.points) {
    if (p.marks.empty()) continue;
    NearestToRays meeting;
    for (const SurveyMark& m : p.marks) {
      const int f = FrameAt(*start, m.run, m.stamp_ns);
      if (f < 0 || !start->frames[f].world_from_body) continue;
      const BodyCamera& camera = input.runs[m.run].cameras[m.camera];
      const auto ray = camera.camera.Unproject(m.pixel);
      if (!ray) continue;
      const Rigid3d map_from_cam = *start->frames[f].world_from_body * camera.cam_from_body.Inverse();
      meeting.Add(map_from_cam.translation, map_from_cam.rotation * *ray);
    }
    const Eigen::Vector3d spread = meeting.Spread();
    if (spread(0) > 1e-6 * spread(2)) start->marked[p.name] = meeting.Point();
  }
}

// world_from_map that brings the bodies' antennas to their fixes. Nothing where the way is too straight to show heading
// and tilt.
std::optional<Rigid3d> JoinGps(const SurveyInput& input, const MapStart& start) {
  std::vector<Eigen::Vector3d> a, b;
  for (size_t r = 0; r < input.runs.size(); ++r) {
    for (const SurveyFix& fix : input.runs[r].gps) {
      const int f = FrameAt(start, static_cast<int>(r), fix.stamp_ns);
      if (f < 0 || !start.frames[f].world_from_body) continue;
      a.push_back(*start.frames[f].world_from_body * fix.arm_m);
      b.push_back(fix.world_m);
    }
  }
  if (!AreWellSpread(a)) return std::nullopt;
  const Sim3d fit = AlignPoints(a, b, AlignmentKind::kSE3);
  return Rigid3d(fit.rotation, fit.translation);
}

// map_from_x that makes the plane through the tags horizontal, up where the bodies' z axes point.
std::optional<Rigid3d> Level(const SurveyInput& input, const MapStart& start) {
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), up = Eigen::Vector3d::Zero();
  for (int id : input.level_tags) {
    const auto tag = start.world_from_tag.find(id);
    if (tag != start.world_from_tag.end()) centres.push_back(tag->second.translation), mean += centres.back();
  }
  if (centres.size() < 3) return std::nullopt;
  mean /= static_cast<double>(centres.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& c : centres) spread += (c - mean) * (c - mean).transpose();
  for (const MapFrame& f : start.frames) {
    // A photo's body is its camera: its y axis points down.
    const bool still = input.runs[static_cast<size_t>(f.run)].stills;
    const Eigen::Vector3d its_up = still ? Eigen::Vector3d(-Eigen::Vector3d::UnitY()) : Eigen::Vector3d::UnitZ();
    if (f.world_from_body) up += f.world_from_body->rotation * its_up;
  }
  Eigen::Vector3d normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  if (normal.dot(up) < 0) normal = -normal;
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(normal, Eigen::Vector3d::UnitZ());
  return Rigid3d(turn, Eigen::Vector3d(0, 0, -(turn * mean).z()));
}

// Everything that is placed, from the map's frame into another.
void Move(const Rigid3d& world_from_map, MapStart* start) {
  for (auto& [id, pose] : start->world_from_tag) pose = world_from_map * pose;
  for (auto& tags : start->by_run) {
    for (auto& [id, pose] : tags) pose = world_from_map * pose;
  }
  for (auto& [name, point] : start->marked) point = world_from_map * point;
  for (MapFrame& frame : start->frames) {
    if (frame.world_from_body) frame.world_from_body = world_from_map * *frame.world_from_body;
  }
}

// Index of a camera by its name; past the last if there is none.
size_t CameraOf(const SurveyRun& run, const std::string& name) {
  const auto is_it = [&](const BodyCamera& c) { return c.name == name; };
  return static_cast<size_t>(std::find_if(run.cameras.begin(), run.cameras.end(), is_it) - run.cameras.begin());
}

std::map<int64_t, std::vector<const ImageDetections*>> ImagesByStamp(const SurveyRun& run) {
  std::map<int64_t, std::vector<const ImageDetections*>> by_stamp;
  for (const ImageDetections& image : run.images) {
    const size_t camera = CameraOf(run, image.camera);
    if (camera == run.cameras.size()) {
      throw InputError("run " + run.name + ": detections name camera \"" + image.camera +
                       "\", which camchain.yaml does not have");
    }
    by_stamp[BodyStamp(image.stamp_ns, run.cameras[camera])].push_back(&image);
  }
  return by_stamp;
}

// The tags in a picture of the frame that comes next.
void AddSights(const SurveyInput& input, const SurveyOptions& options, const ImageDetections& image, MapFrame* frame,
               MapStart* start) {
  const SurveyRun& run = input.runs[static_cast<size_t>(frame->run)];
  const size_t camera = CameraOf(run, image.camera);
  std::map<int, int> seen;
  for (const TagDetection& d : image.detections) ++seen[d.id];
  for (const TagDetection& d : image.detections) {
    if (!(input.sizes.SizeOf(d.id) > 0)) {
      throw InputError("tags.yaml: tag " + std::to_string(d.id) + " has no size; give size_m, or sizes_m for its id");
    }
    // The same id twice in one picture: neither can be told from the other.
    if (seen[d.id] > 1 || d.ShortestSide() < options.min_side_px) continue;
    MapSight s;
    s.frame = static_cast<int>(start->frames.size());
    s.camera = static_cast<int>(camera);
    s.detection = d;
    try {
      s.sight = MakeTagSight(run.cameras[camera].camera, d, options.extra_sigma_px);
    } catch (const NumericError&) {
      continue;  // outside the camera model
    }
    s.place = s.detection.id;
    frame->sights.push_back(static_cast<int>(start->sights.size()));
    start->sights.push_back(s);
  }
}

// Tags of a run by its pictures alone, and its body poses, in a frame of its own.
std::map<int, Rigid3d> PlaceRun(const SurveyInput& input, int run, int threads, const CancelToken& cancel,
                                MapStart* start) {
  const SurveyRun& its = input.runs[static_cast<size_t>(run)];
  if (its.odometry.poses.empty()) return Grow(input, run, threads, cancel, start);
  for (MapFrame& frame : start->frames) {
    if (frame.run != run) continue;
    frame.world_from_body = its.start.At(frame.stamp_ns, static_cast<int64_t>(its.max_gap_s * 1e9));
  }
  if (its.start.poses.empty()) FollowOdometry(input, run, start);
  return TagsOf(input, *start, run, threads, cancel);
}

// The run that joins the map next: of those that wait the one with the most tags in common with it, or with the most
// tags at all if there is no map yet.
int NextRun(const SurveyInput& input, const std::vector<std::map<int, Rigid3d>>& run_tags,
            const std::vector<bool>& joined, const std::map<int, Rigid3d>& map) {
  int next = -1, most = -1;
  // A run comes first, whatever a photo set shows: it is the others that join.
  bool run_waits = false;
  for (size_t r = 0; r < input.runs.size() && map.empty(); ++r) {
    run_waits |= !joined[r] && !input.runs[r].stills && !run_tags[r].empty();
  }
  for (size_t r = 0; r < input.runs.size(); ++r) {
    if (run_waits && input.runs[r].stills) continue;
    int common = 0;
    for (const auto& [id, pose] : run_tags[r]) common += map.count(id) > 0 ? 1 : 0;
    const int size = map.empty() ? static_cast<int>(run_tags[r].size()) : common;
    if (!joined[r] && size > most) most = size, next = static_cast<int>(r);
  }
  return next;
}

// Brings a run's tags and bodies into the map; without a common tag it is left out.
void JoinRun(const SurveyRun& its, int run, const std::map<int, Rigid3d>& tags, MapStart* start) {
  std::optional<Rigid3d> map_from_run = Rigid3d();
  if (!start->world_from_tag.empty()) map_from_run = Join(tags, start->world_from_tag);
  if (!map_from_run || tags.empty()) {
    start->warnings.push_back((its.stills ? "" : "run ") + its.name + " shares no tag with the others and is left out");
    map_from_run.reset();
  }
  for (MapFrame& frame : start->frames) {
    if (frame.run != run) continue;
    if (!map_from_run) frame.world_from_body.reset();
    if (frame.world_from_body) frame.world_from_body = *map_from_run * *frame.world_from_body;
  }
  if (!map_from_run) return;
  for (const auto& [id, pose] : tags) {
    start->by_run[static_cast<size_t>(run)].emplace(id, *map_from_run * pose);
    start->world_from_tag.emplace(id, *map_from_run * pose);
  }
}

// By the tag that is held, else by points, fixes, or the level; nothing if none of them says anything.
std::optional<Rigid3d> WorldFromMap(const SurveyInput& input, const std::vector<SurveyPoint>& datum_points,
                                    MapStart* start) {
  if (input.fixed) {
    const auto tag = start->world_from_tag.find(input.fixed->tag_id);
    if (tag == start->world_from_tag.end()) {
      throw InputError("tag " + std::to_string(input.fixed->tag_id) + ": in no usable picture, but the datum holds it");
    }
    return input.fixed->world_from_tag * tag->second.Inverse();
  }
  std::optional<Rigid3d> world_from_map = JoinPoints(*start, input, datum_points);
  if (!world_from_map && input.use_gps) world_from_map = JoinGps(input, *start);
  start->in_world = world_from_map.has_value();
  if (world_from_map) world_from_map->translation += CommonShift(*start, input, datum_points, *world_from_map);
  return world_from_map ? world_from_map : Level(input, *start);
}

}  // namespace

int FrameAt(const MapStart& start, int run, int64_t stamp_ns) {
  const auto at =
      std::lower_bound(start.frames.begin(), start.frames.end(), std::pair(run, stamp_ns),
                       [](const MapFrame& f, const auto& key) { return std::pair(f.run, f.stamp_ns) < key; });
  const bool found = at != start.frames.end() && at->run == run && at->stamp_ns == stamp_ns;
  return found ? static_cast<int>(at - start.frames.begin()) : -1;
}

Eigen::Vector3d OffsetInWorld(const SurveyPoint& point, const Rigid3d& world_from_tag) {
  if (!point.offset_in_tag_frame) return point.offset_m;
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d out = -(world_from_tag.rotation * Eigen::Vector3d::UnitZ());
  out.z() = 0;
  if (out.norm() < 1e-3) return point.offset_m.z() * up;  // a tag on the floor has no horizontal side
  out.normalize();
  return point.offset_m.x() * up.cross(out) + point.offset_m.y() * out + point.offset_m.z() * up;
}

Eigen::Vector3d OffsetInWorld(const Station& station, const Rigid3d& world_from_tag) {
  SurveyPoint point;
  point.offset_m = station.offset_m;
  point.offset_in_tag_frame = station.in_tag_frame;
  return OffsetInWorld(point, world_from_tag);
}

MapStart CollectSights(const SurveyInput& input, const SurveyOptions& options) {
  MapStart start;
  for (size_t r = 0; r < input.runs.size(); ++r) {
    const SurveyRun& run = input.runs[r];
    std::map<int64_t, std::vector<const ImageDetections*>> by_stamp = ImagesByStamp(run);
    std::set<int64_t> tied;
    for (const SurveyTie& tie : run.ties) tied.insert(tie.stamp_ns);
    for (const SurveyPoint& p : input.points) {
      for (const SurveyMark& m : p.marks) {
        if (m.run == static_cast<int>(r)) tied.insert(m.stamp_ns);
      }
    }
    for (int64_t stamp : tied) by_stamp[stamp];
    const std::set<int64_t> waypoints = Waypoints(run.odometry, by_stamp);
    for (int64_t stamp : waypoints) by_stamp[stamp];
    for (const auto& [stamp, images] : by_stamp) {
      MapFrame frame;
      frame.run = static_cast<int>(r);
      frame.stamp_ns = stamp;
      frame.has_ties = tied.count(stamp) > 0;
      frame.odom_from_body = run.odometry.At(stamp, static_cast<int64_t>(run.max_gap_s * 1e9));
      for (const ImageDetections* image : images) AddSights(input, options, *image, &frame, &start);
      if (!frame.sights.empty() || frame.has_ties || waypoints.count(stamp) > 0) start.frames.push_back(frame);
    }
  }
  return start;
}

std::vector<TagView> ViewsOf(const SurveyInput& input, const MapStart& start, int run) {
  std::vector<TagView> views;
  for (const MapFrame& frame : start.frames) {
    if (!frame.world_from_body || (run >= 0 && frame.run != run)) continue;
    std::map<int, TagView> by_camera;
    for (int i : frame.sights) {
      const MapSight& s = start.sights[i];
      TagView& view = by_camera[s.camera];
      view.camera = &input.runs[frame.run].cameras[s.camera].camera;
      view.world_from_cam = *frame.world_from_body * BodyFromCam(input, start, s);
      view.run = input.runs[frame.run].name;
      view.detections.push_back(s.detection);
    }
    for (auto& [camera, view] : by_camera) views.push_back(std::move(view));
  }
  return views;
}

void FindStart(const SurveyInput& input, const std::vector<SurveyPoint>& datum_points, int threads,
               const CancelToken& cancel, MapStart* start) {
  std::vector<std::map<int, Rigid3d>> run_tags;
  for (int run = 0; run < static_cast<int>(input.runs.size()); ++run) {
    run_tags.push_back(PlaceRun(input, run, threads, cancel, start));
  }
  start->by_run.resize(input.runs.size());
  // Runs join the map of the first in the order of their common tags.
  std::vector<bool> joined(input.runs.size(), false);
  for (size_t round = 0; round < input.runs.size(); ++round) {
    const int next = NextRun(input, run_tags, joined, start->world_from_tag);
    joined[next] = true;
    JoinRun(input.runs[next], next, run_tags[next], start);
  }
  PlaceMarks(input, start);
  if (const auto world_from_map = WorldFromMap(input, datum_points, start)) Move(*world_from_map, start);
}

}  // namespace trigpoint
