#include "app/desktop/scene_styles.h"

#include <vtkCamera.h>
#include <vtkInteractorStyleFlight.h>
#include <vtkInteractorStyleTrackballCamera.h>
#include <vtkObjectFactory.h>
#include <vtkRenderWindow.h>
#include <vtkRenderWindowInteractor.h>
#include <vtkRenderer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace trigpoint {

namespace {

constexpr double kRadians = M_PI / 180;
constexpr double kSteepest_deg = 89;
constexpr double kTurnAcross_deg = 180;  // over the height of the window

// Looks straight down: dragging moves, the wheel zooms.
class PlanStyle : public vtkInteractorStyleTrackballCamera {
 public:
  static PlanStyle* New();
  vtkTypeMacro(PlanStyle, vtkInteractorStyleTrackballCamera) void Rotate() override { Pan(); }
  void Spin() override { Pan(); }
};
vtkStandardNewMacro(PlanStyle)

    class OrbitStyle : public vtkInteractorStyleTrackballCamera {
 public:
  static OrbitStyle* New();
  vtkTypeMacro(OrbitStyle, vtkInteractorStyleTrackballCamera) void Rotate() override {
    if (CurrentRenderer == nullptr || pivot == nullptr) return;
    Turn(*pivot, -kTurnAcross_deg);  // the scene follows the mouse
  }
  void Spin() override { Rotate(); }
  const Eigen::Vector3d* pivot = nullptr;

 protected:
  void Turn(const Eigen::Vector3d& about, double across_deg) {
    const double per_pixel = across_deg / std::max(1, Interactor->GetRenderWindow()->GetSize()[1]);
    const int* now = Interactor->GetEventPosition();
    const int* before = Interactor->GetLastEventPosition();
    TurnAbout(CurrentRenderer->GetActiveCamera(), about, per_pixel * (now[0] - before[0]),
              per_pixel * (before[1] - now[1]));
    CurrentRenderer->ResetCameraClippingRange();
    Interactor->Render();
  }
};
vtkStandardNewMacro(OrbitStyle)

    // The eye stays where it is, at the panorama's centre; what is dragged stays under the mouse.
    class InsideStyle : public OrbitStyle {
 public:
  static InsideStyle* New();
  vtkTypeMacro(InsideStyle, OrbitStyle) void Rotate() override {
    if (CurrentRenderer == nullptr) return;
    vtkCamera* camera = CurrentRenderer->GetActiveCamera();
    Turn(Eigen::Vector3d(camera->GetPosition()), camera->GetViewAngle());
  }
  void Pan() override { Rotate(); }
  void Dolly() override { Rotate(); }
};
vtkStandardNewMacro(InsideStyle)

}  // namespace

vtkSmartPointer<vtkInteractorStyle> MakeSceneStyle(const std::string& mode, const Eigen::Vector3d* pivot) {
  if (mode == "plan") return vtkSmartPointer<PlanStyle>::New();
  if (mode == "fly") return vtkSmartPointer<vtkInteractorStyleFlight>::New();
  if (mode == "inside") return vtkSmartPointer<InsideStyle>::New();
  const auto orbit = vtkSmartPointer<OrbitStyle>::New();
  orbit->pivot = pivot;
  return orbit;
}

void TurnAbout(vtkCamera* camera, const Eigen::Vector3d& pivot, double left_deg, double up_deg) {
  const Eigen::Vector3d eye(camera->GetPosition()), focus(camera->GetFocalPoint());
  const Eigen::Vector3d ahead = (focus - eye).normalized();
  const double slope_deg = std::asin(std::clamp(ahead.z(), -1.0, 1.0)) / kRadians;
  up_deg = std::clamp(slope_deg + up_deg, -kSteepest_deg, kSteepest_deg) - slope_deg;
  Eigen::Vector3d right = ahead.cross(Eigen::Vector3d::UnitZ());
  if (right.norm() < 1e-6) right = ahead.cross(Eigen::Vector3d(camera->GetViewUp()));
  right.normalize();
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(left_deg * kRadians, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(up_deg * kRadians, right))
          .toRotationMatrix();
  const Eigen::Vector3d new_eye = pivot + turn * (eye - pivot), new_focus = pivot + turn * (focus - pivot);
  camera->SetPosition(new_eye.data());
  camera->SetFocalPoint(new_focus.data());
  camera->SetViewUp(0, 0, 1);
}

}  // namespace trigpoint
