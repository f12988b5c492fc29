#include "eval/evidence/tag_views.h"

#include <map>

#include "datasets/io/camchain.h"

namespace trigpoint {
namespace {

std::map<int64_t, Rigid3d> OdomFromBody(const BodyCamera& first, const LocalizeResult& result,
                                        const Solution* solution) {
  std::map<int64_t, Rigid3d> odom_from_body;
  if (solution == nullptr) {
    for (const TimedPose& pose : result.cameras_odom)
      odom_from_body.emplace(BodyStamp(pose.stamp_ns, first), pose.target_from_body * first.cam_from_body);
    return odom_from_body;
  }
  for (size_t k = 0; k < solution->pose_stamps.size(); ++k)
    odom_from_body.emplace(solution->pose_stamps[k], OdomFromRig(*solution, static_cast<int>(k)));
  return odom_from_body;
}

}  // namespace

OwnViews TagViews(const Run& run, const LocalizeResult& result, const Solution* solution,
                  const std::vector<ImageDetections>& images) {
  OwnViews own;
  if (run.cameras.empty()) return own;
  const std::map<int64_t, Rigid3d> odom_from_body = OdomFromBody(run.cameras.front(), result, solution);
  for (const ImageDetections& image : images) {
    if (image.detections.empty()) continue;
    for (const BodyCamera& camera : run.cameras) {
      if (camera.name != image.camera) continue;
      const auto pose = odom_from_body.find(BodyStamp(image.stamp_ns, camera));
      if (pose == odom_from_body.end()) continue;
      TagView view;
      view.camera = &camera.camera;
      view.world_from_cam = pose->second * camera.cam_from_body.Inverse();
      view.run = run.name;
      view.detections = image.detections;
      own.views.push_back(std::move(view));
      own.images.emplace_back(image.stamp_ns, image.camera);
    }
  }
  return own;
}

}  // namespace trigpoint
