#include "survey/tags/map_start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/base/error.h"
#include "calib/geometry/alignment.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kStartGatePx = 40;  // odometry drifts between visits

double ShortestSide(const TagDetection& d) {
  double side = 1e300;
  for (int k = 0; k < 4; ++k) side = std::min(side, (d.corners[(k + 1) % 4] - d.corners[k]).norm());
  return side;
}

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

// world_from_map from points: every triple proposes, all judge by their sigmas.
std::optional<Rigid3d> JoinPoints(const std::map<int, Rigid3d>& tags, const SurveyInput& input,
                                  const std::vector<SurveyPoint>& points) {
  std::vector<Eigen::Vector3d> a, b;
  std::vector<double> sigma;
  for (const SurveyPoint& p : points) {
    const auto tag = tags.find(p.tag_id);
    if (tag == tags.end()) continue;
    a.push_back(p.corner < 0 ? tag->second.translation
                             : tag->second * TagCorner(input.sizes.SizeOf(p.tag_id), p.corner));
    b.push_back(p.world_m - p.offset_m);
    sigma.push_back(std::max(0.5, 3 * std::hypot(p.sigma_h_m, p.sigma_v_m)));
  }
  const int n = static_cast<int>(std::min<size_t>(a.size(), 25));
  std::optional<Rigid3d> best;
  double best_score = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      for (int k = j + 1; k < n; ++k) {
        const double base = (b[j] - b[i]).norm();
        if ((b[j] - b[i]).cross(b[k] - b[i]).norm() < 0.02 * base * base) continue;  // on a line
        const Sim3d fit = AlignPoints({a[i], a[j], a[k]}, {b[i], b[j], b[k]}, AlignmentKind::kSE3);
        double score = 0;
        for (size_t m = 0; m < a.size(); ++m) score += std::exp(-(fit * a[m] - b[m]).norm() / sigma[m]);
        if (score > best_score) best_score = score, best = Rigid3d(fit.rotation, fit.translation);
      }
    }
  }
  return best;
}

}  // namespace

MapStart CollectSights(const SurveyInput& input, const SurveyOptions& options) {
  MapStart start;
  for (size_t r = 0; r < input.runs.size(); ++r) {
    const SurveyRun& run = input.runs[r];
    std::map<int64_t, std::vector<const ImageDetections*>> by_stamp;
    for (const ImageDetections& image : run.images) by_stamp[image.stamp_ns].push_back(&image);
    for (const auto& [stamp, images] : by_stamp) {
      MapFrame frame;
      frame.run = static_cast<int>(r);
      frame.stamp_ns = stamp;
      frame.odom_from_body = run.odometry.At(stamp, static_cast<int64_t>(run.max_gap_s * 1e9));
      for (const ImageDetections* image : images) {
        const auto camera = std::find_if(run.cameras.begin(), run.cameras.end(),
                                         [&](const BodyCamera& c) { return c.name == image->camera; });
        if (camera == run.cameras.end()) {
          throw InputError("run " + run.name + ": detections name camera \"" + image->camera +
                           "\", which camchain.yaml does not have");
        }
        std::map<int, int> seen;
        for (const TagDetection& d : image->detections) ++seen[d.id];
        for (const TagDetection& d : image->detections) {
          if (!(input.sizes.SizeOf(d.id) > 0)) {
            throw InputError("tags.yaml: tag " + std::to_string(d.id) +
                             " has no size; give size_m, or sizes_m for its id");
          }
          // The same id twice in one picture: neither can be told from the other.
          if (seen[d.id] > 1 || ShortestSide(d) < options.min_side_px) continue;
          MapSight s;
          s.frame = static_cast<int>(start.frames.size());
          s.camera = static_cast<int>(camera - run.cameras.begin());
          s.detection = d;
          try {
            s.sight = MakeTagSight(camera->camera, d, options.extra_sigma_px);
          } catch (const NumericError&) {
            continue;  // outside the camera model
          }
          frame.sights.push_back(static_cast<int>(start.sights.size()));
          start.sights.push_back(s);
        }
      }
      if (!frame.sights.empty()) start.frames.push_back(frame);
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
  std::vector<std::map<int, Rigid3d>> run_tags(input.runs.size());
  for (size_t r = 0; r < input.runs.size(); ++r) {
    const int run = static_cast<int>(r);
    if (input.runs[r].odometry.poses.empty()) {
      run_tags[r] = Grow(input, run, threads, cancel, start);
    } else {
      for (MapFrame& frame : start->frames) {
        if (frame.run == run) frame.world_from_body = frame.odom_from_body;
      }
      run_tags[r] = TagsOf(input, *start, run, threads, cancel);
    }
  }
  // Runs join the map of the first in the order of their common tags.
  std::vector<bool> joined(input.runs.size(), false);
  for (size_t round = 0; round < input.runs.size(); ++round) {
    int next = -1, most = -1;
    for (size_t r = 0; r < input.runs.size(); ++r) {
      int common = 0;
      for (const auto& [id, pose] : run_tags[r]) common += start->world_from_tag.count(id) > 0 ? 1 : 0;
      const int size = start->world_from_tag.empty() ? static_cast<int>(run_tags[r].size()) : common;
      if (!joined[r] && size > most) most = size, next = static_cast<int>(r);
    }
    joined[next] = true;
    std::optional<Rigid3d> map_from_run = Rigid3d();
    if (!start->world_from_tag.empty()) map_from_run = Join(run_tags[next], start->world_from_tag);
    if (!map_from_run || run_tags[next].empty()) {
      start->warnings.push_back("run " + input.runs[next].name + " shares no tag with the others and is left out");
      map_from_run.reset();
    }
    for (MapFrame& frame : start->frames) {
      if (frame.run != next) continue;
      if (!map_from_run) frame.world_from_body.reset();
      if (frame.world_from_body) frame.world_from_body = *map_from_run * *frame.world_from_body;
    }
    if (!map_from_run) continue;
    for (const auto& [id, pose] : run_tags[next]) start->world_from_tag.emplace(id, *map_from_run * pose);
  }
  std::optional<Rigid3d> world_from_map;
  if (input.fixed) {
    const auto tag = start->world_from_tag.find(input.fixed->tag_id);
    if (tag == start->world_from_tag.end()) {
      throw InputError("tag " + std::to_string(input.fixed->tag_id) + " is to be held but no usable picture shows it");
    }
    world_from_map = input.fixed->world_from_tag * tag->second.Inverse();
  } else {
    world_from_map = JoinPoints(start->world_from_tag, input, datum_points);
    start->in_world = world_from_map.has_value();
  }
  if (!world_from_map) return;
  for (auto& [id, pose] : start->world_from_tag) pose = *world_from_map * pose;
  for (MapFrame& frame : start->frames) {
    if (frame.world_from_body) frame.world_from_body = *world_from_map * *frame.world_from_body;
  }
}

}  // namespace trigpoint
