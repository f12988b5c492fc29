// VTK's side of the scene desk.
#pragma once

#include <QVTKOpenGLNativeWidget.h>
#include <vtkActor.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkCamera.h>
#include <vtkCommand.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkNew.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>

#include <Eigen/Geometry>
#include <QPointF>
#include <memory>
#include <optional>

#include "app/desktop/scene_desk.h"
#include "calib/geo/geodetic.h"
#include "datasets/export/crs.h"
#include "eval/scene/scene_view.h"

namespace trigpoint {

// What is loaded in the background.
struct LoadedScene {
  SceneModel model;
  // Of the project or release that is shown, where it is on the earth: what turns its site coordinates into others.
  std::optional<LocalFrame> frame;
  std::shared_ptr<const Crs> crs;  // null: none, or it needs PROJ, which isn't there
};

struct SceneDesk::Vtk {
  QVTKOpenGLNativeWidget* widget = nullptr;
  vtkNew<vtkGenericOpenGLRenderWindow> window;
  vtkNew<vtkRenderer> renderer;
  vtkNew<vtkRenderer> sky;  // behind the scene: the panorama one stands in
  std::shared_ptr<const LoadedScene> scene;
  std::unique_ptr<SceneView> view;            // of scene->model
  std::shared_ptr<const LoadedScene> rgb_of;  // whose points got their colours from the pictures
  std::vector<vtkSmartPointer<vtkProp>> highlights;
  std::vector<vtkSmartPointer<vtkProp>> measure;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();  // about which a drag turns
  vtkNew<vtkCamera> outside;                        // where one looked from before stepping inside
  size_t inside = 0;                                // index of the panorama one stands in
  vtkSmartPointer<vtkActor> sphere;
  vtkSmartPointer<vtkCommand> detail;
  bool dragged = false;  // by the mouse
  bool shades = false;   // by depth, while the view rests
  QStringList highlighted;
  std::vector<int> cameras;  // indices into the model, of the run that is scrubbed, by time
  bool looked = false;       // the user's view is kept over reloads

  const SceneModel* model() const { return scene ? &scene->model : nullptr; }
  // What the scene has of an object: a panorama's answers and their errors, a tag's poses; the main one first.
  std::vector<ScenePick> Find(const std::string& object) const;
  void Clear(std::vector<vtkSmartPointer<vtkProp>>& props);
  // It faces the viewer and hides nothing; `radius` (m) as far as that is neither a dot nor fills the picture.
  void AddRing(std::vector<vtkSmartPointer<vtkProp>>& props, const Eigen::Vector3d& at, double radius);
  void SizeRings(double pixel_ratio);  // as the camera stands
  // Of a pixel (device pixels from the top left) the place on the ground, else at the distance one looks at.
  Eigen::Vector3d PlaceUnder(double x, double y) const;
  // What is picked at such a pixel.
  std::optional<ScenePick> Pick(const QPointF& at) const;
  // Where it is drawn, else the place under the pixel: what one turns about and zooms to.
  Eigen::Vector3d Aim(const QPointF& at) const;
  void Move(const Eigen::Vector3d& by);  // the camera
  void AddLine(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const std::string& text);
  void DrawMoving(bool moving);
  // Eye-dome lighting: what stands before something is outlined, so that bare points look solid.
  void ShadeByDepth(bool on);
  void UseShading(bool on);
  // The same direction of view, with the box as large as it fits, or a few metres.
  void Fit(const Eigen::AlignedBox3d& box);
  // The camera of an image.
  void LookThrough(const SceneCamera& camera);
  // A sphere about the viewer with the panorama on it.
  void ShowSky(const ScenePanorama& panorama, const cv::Mat& picture);
  void HideSky();
  // The sky turns with the scene's camera and never moves.
  void SyncSky();
  cv::Mat Picture(int width, int height);
};

}  // namespace trigpoint
