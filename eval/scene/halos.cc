#include "eval/scene/halos.h"

#include <vtkActor.h>
#include <vtkCamera.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "eval/scene/props.h"
#include "eval/scene/scene_parts.h"
#include "eval/text/luminance.h"

namespace trigpoint {
namespace {

constexpr double kLight = 0.3;   // luminance
constexpr double kBelow = 0.05;  // m

// Where the ray of a camera through a point reaches the height `z`: the same pixel, behind all paths.
Eigen::Vector3d Behind(vtkCamera* camera, const Eigen::Vector3d& point, double z) {
  Eigen::Vector3d ray(camera->GetDirectionOfProjection());
  if (camera->GetParallelProjection() == 0) ray = point - Eigen::Vector3d(camera->GetPosition());
  constexpr double kSteep = 0.05;  // of a ray that reaches the ground near the site
  if (ray.z() > -kSteep * ray.norm() || point.z() <= z) return point;
  return point + (z - point.z()) / ray.z() * ray;
}

}  // namespace

struct Halos::Parts {
  vtkRenderer* renderer;
  std::vector<vtkSmartPointer<vtkActor>> actors;
};

Halos::Halos(const SceneModel& model, const SceneView& view, vtkRenderer* renderer, double width_px)
    : parts_(new Parts{renderer, {}}) {
  std::vector<const ScenePath*> paths;
  double level = std::numeric_limits<double>::infinity();
  for (const ScenePath& path : model.paths) {
    if (path.poses.size() < 2 || SceneView::ColourOfLayer(LayerOf(path.kind)).empty()) continue;
    if (!view.Visible(LayerOf(path.kind))) continue;
    paths.push_back(&path);
    for (const TimedPose& pose : path.poses) level = std::min(level, pose.target_from_body.translation.z());
  }
  level = std::max(level, model.ground_z + 3 * kBelow);  // else the ground hides them
  for (const ScenePath* path : paths) {
    const bool light = Luminance(SceneView::ColourOfLayer(LayerOf(path->kind))) > kLight;
    std::vector<Eigen::Vector3d> line;
    for (const TimedPose& pose : path->poses)
      line.push_back(
          Behind(renderer->GetActiveCamera(), pose.target_from_body.translation, level - (light ? 2 : 1) * kBelow));
    parts_->actors.push_back(FlatActor(Lines({line}), light ? kBlack : kWhite, width_px));
    renderer->AddViewProp(parts_->actors.back());
  }
}

Halos::~Halos() {
  for (const auto& actor : parts_->actors) parts_->renderer->RemoveViewProp(actor);
}

}  // namespace trigpoint
