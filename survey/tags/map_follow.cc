#include <algorithm>
#include <cmath>
#include <limits>

#include "survey/tags/map_start.h"
#include "survey/tags/planar_pose.h"

namespace trigpoint {
namespace {

constexpr double kLostPx = 12;        // a frame whose known tags are farther off asks whether odometry has left the map
constexpr double kMostPx = 40;        // one sight counts no more
constexpr size_t kWindow = 10;        // frames or pictures that judge together
constexpr double kImprovement = 0.5;  // of the summed residual, for odometry to be tied anew

class Follower {
 public:
  Follower(const SurveyInput& input, int run, MapStart* start) : input_(input), start_(*start) {
    for (size_t f = 0; f < start_.frames.size(); ++f) {
      if (start_.frames[f].run == run && start_.frames[f].odom_from_body) frames_.push_back(f);
    }
  }

  void Run() {
    Rigid3d run_from_odom;
    for (size_t at = 0; at < frames_.size(); ++at) {
      MapFrame& frame = start_.frames[frames_[at]];
      if (ErrorPx(frame, run_from_odom * *frame.odom_from_body) > kLostPx) TieAnew(at, &run_from_odom);
      frame.world_from_body = run_from_odom * *frame.odom_from_body;
      for (int i : frame.sights) {
        const int id = start_.sights[static_cast<size_t>(i)].detection.id;
        if (tags_.count(id) == 0) Place(id, at, run_from_odom);
      }
    }
  }

 private:
  double SightPx(const MapSight& s, const Rigid3d& world_from_body, const Rigid3d& tag) const {
    const double size = input_.sizes.SizeOf(s.detection.id);
    const Rigid3d& cam_from_body = CameraOf(s).cam_from_body;
    if (!TagFaces(s.sight, size, cam_from_body * world_from_body.Inverse() * tag)) return kMostPx;
    return std::min(kMostPx, ResidualPx(s.sight, TagResidual(s.sight, size, cam_from_body, world_from_body, tag)));
  }

  const BodyCamera& CameraOf(const MapSight& s) const {
    const MapFrame& frame = start_.frames[static_cast<size_t>(s.frame)];
    return input_.runs[static_cast<size_t>(frame.run)].cameras[static_cast<size_t>(s.camera)];
  }

  // Mean of the sights of known tags, px; -1: none.
  double ErrorPx(const MapFrame& frame, const Rigid3d& world_from_body) const {
    double sum = 0;
    int n = 0;
    for (int i : frame.sights) {
      const MapSight& s = start_.sights[static_cast<size_t>(i)];
      const auto tag = tags_.find(s.detection.id);
      if (tag == tags_.end()) continue;
      sum += SightPx(s, world_from_body, tag->second);
      ++n;
    }
    return n > 0 ? sum / n : -1;
  }

  // Where the coming frames agree on another place of the body against the known tags, odometry goes on from there.
  void TieAnew(size_t at, Rigid3d* run_from_odom) const {
    std::vector<size_t> window;
    for (size_t k = at; k < frames_.size() && window.size() < kWindow; ++k) {
      if (ErrorPx(start_.frames[frames_[k]], Rigid3d()) >= 0) window.push_back(frames_[k]);
    }
    const auto score = [&](const Rigid3d& t) {
      double sum = 0;
      for (size_t f : window) sum += ErrorPx(start_.frames[f], t * *start_.frames[f].odom_from_body);
      return sum;
    };
    double best = kImprovement * score(*run_from_odom);
    for (size_t f : window) {
      const MapFrame& frame = start_.frames[f];
      for (int i : frame.sights) {
        const MapSight& s = start_.sights[static_cast<size_t>(i)];
        const auto tag = tags_.find(s.detection.id);
        if (tag == tags_.end()) continue;
        for (const PlanarPose& pose : EstimatePlanarPoses(s.sight, input_.sizes.SizeOf(s.detection.id))) {
          const Rigid3d t =
              tag->second * pose.cam_from_tag.Inverse() * CameraOf(s).cam_from_body * frame.odom_from_body->Inverse();
          const double sum = score(t);
          if (sum < best) best = sum, *run_from_odom = t;
        }
      }
    }
  }

  // A new tag: the planar solution that explains its next pictures best.
  void Place(int id, size_t at, const Rigid3d& run_from_odom) {
    std::vector<const MapSight*> sights;
    for (size_t k = at; k < frames_.size() && sights.size() < kWindow; ++k) {
      for (int i : start_.frames[frames_[k]].sights) {
        const MapSight& s = start_.sights[static_cast<size_t>(i)];
        if (s.detection.id == id) sights.push_back(&s);
      }
    }
    const auto body = [&](const MapSight& s) {
      return run_from_odom * *start_.frames[static_cast<size_t>(s.frame)].odom_from_body;
    };
    double best = std::numeric_limits<double>::infinity();
    for (const MapSight* s : sights) {
      for (const PlanarPose& pose : EstimatePlanarPoses(s->sight, input_.sizes.SizeOf(id))) {
        const Rigid3d tag = body(*s) * CameraOf(*s).cam_from_body.Inverse() * pose.cam_from_tag;
        double sum = 0;
        for (const MapSight* other : sights) sum += SightPx(*other, body(*other), tag);
        if (sum < best) best = sum, tags_[id] = tag;
      }
    }
  }

  const SurveyInput& input_;
  MapStart& start_;
  std::vector<size_t> frames_;
  std::map<int, Rigid3d> tags_;
};

}  // namespace

void FollowOdometry(const SurveyInput& input, int run, MapStart* start) { Follower(input, run, start).Run(); }

}  // namespace trigpoint
