#include "app/desktop/scene_vtk.h"

#include <vtkCamera.h>
#include <vtkFollower.h>
#include <vtkImageData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkRenderStepsPass.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>
#include <vtkWindowToImageFilter.h>

#include <opencv2/core.hpp>

#include "app/desktop/depth_shading.h"
#include "calib/camera/camera.h"
#include "datasets/io/text.h"
#include "eval/scene/props.h"

namespace trigpoint {

namespace {

constexpr double kFarGround = 4;      // times as far as what one looks at, the ground is no longer meant
constexpr double kLeastRadius_m = 5;  // of what is looked at
constexpr double kMargin = 1.2;       // about it
constexpr double kSmallestRing_px = 9, kLargestRing_px = 40;
constexpr int kSkyColumns = 128, kSkyRows = 64;

}  // namespace

std::vector<ScenePick> SceneDesk::Vtk::Find(const std::string& object) const {
  std::vector<ScenePick> picks;
  if (!view) return picks;
  const SceneModel& m = scene->model;
  const auto gather = [&](const char* layer, const auto& entries, const auto& matches) {
    for (size_t i = 0; i < entries.size(); ++i) {
      if (matches(entries[i])) picks.push_back(view->Describe(layer, static_cast<int>(i)));
    }
  };
  const std::string kind = object.substr(0, object.find(':')), name = object.substr(object.find(':') + 1);
  if (kind == "tag") gather("tags", m.tags, [&](const SceneTag& t) { return std::to_string(t.id) == name; });
  if (kind == "image")
    gather("cameras", m.cameras, [&](const SceneCamera& c) { return c.run + "/" + c.image == name; });
  if (kind == "panorama" || kind == "station") {
    const auto matches = [&](const auto& p) { return (kind == "panorama" ? p.panorama : p.station) == name; };
    gather("panoramas", m.panoramas, matches);
    gather("errors", m.errors, matches);
  }
  if (kind == "control") gather("control", m.control, [&](const SceneControl& c) { return c.name == name; });
  if (kind == "point") {
    gather("points", m.points, [&](const ScenePoint& p) {
      return name == m.runs[static_cast<size_t>(p.run)] + "/" + std::to_string(p.id);
    });
  }
  return picks;
}

void SceneDesk::Vtk::Clear(std::vector<vtkSmartPointer<vtkProp>>& props) {
  for (const auto& prop : props) {
    prop->ReleaseGraphicsResources(window);
    renderer->RemoveViewProp(prop);
  }
  props.clear();
}

void SceneDesk::Vtk::AddRing(std::vector<vtkSmartPointer<vtkProp>>& props, const Eigen::Vector3d& at, double radius) {
  std::vector<Eigen::Vector3d> circle;
  for (int i = 0; i <= 48; ++i) {
    const double angle = 2 * M_PI * i / 48;
    circle.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0);
  }
  // Black with a white edge, as other desks have it: no layer and no series has that.
  for (const auto& [colour, width] : {std::pair(Colour{1, 1, 1}, 7), {kBlack, 3}}) {
    const auto line = FlatActor(Lines({circle}), colour, width);
    const auto ring = vtkSmartPointer<vtkFollower>::New();
    ring->SetMapper(line->GetMapper());
    ring->SetProperty(line->GetProperty());
    ring->SetPosition(at.x(), at.y(), at.z());
    ring->SetCamera(renderer->GetActiveCamera());
    ring->PickableOff();
    renderer->AddActor(ring);
    props.emplace_back(ring);
  }
}

void SceneDesk::Vtk::SizeRings(double pixel_ratio) {
  vtkCamera* camera = renderer->GetActiveCamera();
  const Eigen::Vector3d eye(camera->GetPosition()), ahead(camera->GetDirectionOfProjection());
  const double height_px = std::max(1, renderer->GetSize()[1]) / pixel_ratio;
  for (const auto* props : {&highlights, &measure}) {
    for (const auto& prop : *props) {
      auto* ring = vtkFollower::SafeDownCast(prop);
      if (ring == nullptr) continue;
      const double away = (Eigen::Vector3d(ring->GetPosition()) - eye).dot(ahead);
      const double half_height_m = camera->GetParallelProjection() != 0
                                       ? camera->GetParallelScale()
                                       : std::abs(away) * std::tan(camera->GetViewAngle() * M_PI / 360);
      const double metres_per_px = 2 * half_height_m / height_px;
      const double radius_px = ring->GetMapper()->GetBounds()[1] / metres_per_px;  // a circle about 0
      if (std::isfinite(radius_px))
        ring->SetScale(std::clamp(radius_px, kSmallestRing_px, kLargestRing_px) / radius_px);
    }
  }
}

Eigen::Vector3d SceneDesk::Vtk::PlaceUnder(double x, double y) const {
  vtkCamera* camera = renderer->GetActiveCamera();
  const Eigen::Vector3d eye(camera->GetPosition()), focus(camera->GetFocalPoint());
  renderer->SetWorldPoint(focus.x(), focus.y(), focus.z(), 1);
  renderer->WorldToDisplay();
  const double depth = renderer->GetDisplayPoint()[2];
  const auto world = [&](double at_depth) {
    renderer->SetDisplayPoint(x, window->GetSize()[1] - 1 - y, at_depth);
    renderer->DisplayToWorld();
    const double* p = renderer->GetWorldPoint();
    return Eigen::Vector3d(p[0] / p[3], p[1] / p[3], p[2] / p[3]);
  };
  const Eigen::Vector3d at_focus = world(depth);
  const Eigen::Vector3d from = camera->GetParallelProjection() ? world(0) : eye;
  const Eigen::Vector3d ray = at_focus - from;
  if (!scene || std::abs(ray.z()) < 1e-9) return at_focus;
  const double t = (scene->model.ground_z - from.z()) / ray.z();
  return t > 0 && t < kFarGround ? Eigen::Vector3d(from + t * ray) : at_focus;
}

std::optional<ScenePick> SceneDesk::Vtk::Pick(const QPointF& at) const {
  if (!view) return std::nullopt;
  return view->Pick(renderer, at.x(), window->GetSize()[1] - 1 - at.y());
}

Eigen::Vector3d SceneDesk::Vtk::Aim(const QPointF& at) const {
  // Seen from straight above, how high it is makes no difference.
  const bool parallel = renderer->GetActiveCamera()->GetParallelProjection() != 0;
  const std::optional<ScenePick> pick = parallel ? std::nullopt : Pick(at);
  return pick ? pick->drawn_at : PlaceUnder(at.x(), at.y());
}

void SceneDesk::Vtk::Move(const Eigen::Vector3d& by) {
  vtkCamera* camera = renderer->GetActiveCamera();
  const Eigen::Vector3d eye = Eigen::Vector3d(camera->GetPosition()) + by;
  const Eigen::Vector3d focus = Eigen::Vector3d(camera->GetFocalPoint()) + by;
  camera->SetPosition(eye.data());
  camera->SetFocalPoint(focus.data());
}

void SceneDesk::Vtk::AddLine(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const std::string& text) {
  const auto line = FlatActor(Lines({{from, to}}), kVermilion, 3);
  line->PickableOff();
  const auto label = Label(text, 0.5 * (from + to), 18);
  label->PickableOff();
  renderer->AddViewProp(line);
  renderer->AddViewProp(label);
  measure.emplace_back(line);
  measure.emplace_back(label);
}

void SceneDesk::Vtk::DrawMoving(bool moving) {
  if (view) view->DrawMoving(moving);
  if (shades) UseShading(!moving);
}

void SceneDesk::Vtk::ShadeByDepth(bool on) {
  shades = on;
  UseShading(on);
}

void SceneDesk::Vtk::UseShading(bool on) {
  if (on == (renderer->GetPass() != nullptr)) return;
  if (!on) {
    widget->makeCurrent();
    renderer->GetPass()->ReleaseGraphicsResources(window);
    renderer->SetPass(nullptr);
    return;
  }
  vtkNew<vtkRenderStepsPass> steps;
  vtkNew<DepthShading> shading;
  shading->SetDelegatePass(steps);
  renderer->SetPass(shading);
}

void SceneDesk::Vtk::Fit(const Eigen::AlignedBox3d& box) {
  vtkCamera* camera = renderer->GetActiveCamera();
  const double radius = std::max(kLeastRadius_m, kMargin * 0.5 * box.diagonal().norm());
  const int* size = window->GetSize();
  const double aspect = size[1] > 0 ? std::min(1.0, static_cast<double>(size[0]) / size[1]) : 1;
  double away = camera->GetDistance();
  if (camera->GetParallelProjection()) {
    camera->SetParallelScale(radius / aspect);
  } else {
    away = radius / std::sin(std::atan(aspect * std::tan(0.5 * camera->GetViewAngle() * M_PI / 180)));
  }
  const Eigen::Vector3d at = box.center(), ahead(camera->GetDirectionOfProjection());
  const Eigen::Vector3d eye = at - away * ahead;
  camera->SetFocalPoint(at.data());
  camera->SetPosition(eye.data());
  renderer->ResetCameraClippingRange();
}

void SceneDesk::Vtk::LookThrough(const SceneCamera& shown) {
  const Eigen::Vector3d eye = shown.world_from_cam.translation;
  const Eigen::Vector3d ahead = eye + shown.world_from_cam.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d up = shown.world_from_cam.rotation * -Eigen::Vector3d::UnitY();
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOff();
  camera->SetPosition(eye.x(), eye.y(), eye.z());
  camera->SetFocalPoint(ahead.x(), ahead.y(), ahead.z());
  camera->SetViewUp(up.x(), up.y(), up.z());
  double angle = 60;
  if (shown.corner_rays.size() == 4) {
    const Eigen::Vector3d& top = shown.corner_rays[3];
    const Eigen::Vector3d& bottom = shown.corner_rays[0];
    if (top.z() > 0 && bottom.z() > 0) {
      angle = (std::atan2(bottom.y(), bottom.z()) - std::atan2(top.y(), top.z())) * 180 / M_PI;
    }
  }
  camera->SetViewAngle(std::clamp(angle, 10.0, 120.0));
  renderer->ResetCameraClippingRange();
}

void SceneDesk::Vtk::ShowSky(const ScenePanorama& panorama, const cv::Mat& picture) {
  HideSky();
  const Camera lens = Camera::Equirectangular(kSkyColumns, kSkyRows);
  std::vector<Eigen::Vector3d> vertices;
  for (int row = 0; row <= kSkyRows; ++row) {
    for (int column = 0; column <= kSkyColumns; ++column) {
      const Eigen::Vector2d pixel(column - 0.5, std::clamp(row - 0.5, -0.499, kSkyRows - 0.501));
      const auto ray = lens.Unproject(pixel);
      vertices.push_back(panorama.world_from_pano.rotation * ray.value_or(Eigen::Vector3d::UnitZ()));
    }
  }
  sphere = TexturedActor(TexturedGrid(vertices, kSkyColumns + 1, kSkyRows + 1), picture, false);
  sphere->PickableOff();
  sky->AddActor(sphere);
  window->AddRenderer(sky);
  renderer->SetLayer(1);
  outside->DeepCopy(renderer->GetActiveCamera());
  const Eigen::Vector3d eye = panorama.world_from_pano.translation;
  const Eigen::Vector3d ahead = eye + panorama.world_from_pano.rotation * Eigen::Vector3d::UnitZ();
  vtkCamera* camera = renderer->GetActiveCamera();
  camera->ParallelProjectionOff();
  camera->SetPosition(eye.x(), eye.y(), eye.z());
  camera->SetFocalPoint(ahead.x(), ahead.y(), ahead.z());
  camera->SetViewUp(0, 0, 1);
  camera->SetViewAngle(75);
  renderer->ResetCameraClippingRange();
  SyncSky();
}

void SceneDesk::Vtk::HideSky() {
  if (!sphere) return;
  sphere->ReleaseGraphicsResources(window);
  sky->RemoveActor(sphere);
  sphere = nullptr;
  renderer->SetLayer(0);
  window->RemoveRenderer(sky);
  renderer->GetActiveCamera()->DeepCopy(outside);  // leaving leaves nothing behind
  renderer->ResetCameraClippingRange();
}

void SceneDesk::Vtk::SyncSky() {
  if (!sphere) return;
  vtkCamera* from = renderer->GetActiveCamera();
  vtkCamera* to = sky->GetActiveCamera();
  double direction[3], up[3];
  from->GetDirectionOfProjection(direction);
  from->GetViewUp(up);
  to->SetPosition(0, 0, 0);
  to->SetFocalPoint(direction);
  to->SetViewUp(up);
  to->SetViewAngle(from->GetViewAngle());
  to->SetClippingRange(0.1, 10);
}

cv::Mat SceneDesk::Vtk::Picture(int width, int height) {
  const int* before = window->GetSize();
  const int old_width = before[0], old_height = before[1];
  DrawMoving(false);
  widget->makeCurrent();
  window->SetSize(width, height);
  if (!sphere) renderer->ResetCameraClippingRange();  // what was seen before changes no pixel
  window->Render();
  vtkNew<vtkWindowToImageFilter> filter;
  filter->SetInput(window);
  filter->SetInputBufferTypeToRGB();
  filter->ReadFrontBufferOff();
  filter->ShouldRerenderOff();
  filter->Update();
  vtkImageData* image = filter->GetOutput();
  const int* size = image->GetDimensions();
  cv::Mat picture(size[1], size[0], CV_8UC3);
  for (int y = 0; y < size[1]; ++y) {
    for (int x = 0; x < size[0]; ++x) {
      const auto* p = static_cast<const unsigned char*>(image->GetScalarPointer(x, size[1] - 1 - y, 0));
      picture.at<cv::Vec3b>(y, x) = cv::Vec3b(p[0], p[1], p[2]);
    }
  }
  window->SetSize(old_width, old_height);
  return picture;
}

}  // namespace trigpoint
