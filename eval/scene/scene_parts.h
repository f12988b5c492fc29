// SceneView's inside, shared by its translation units. VTK only.
#pragma once

#include <vtkActor.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkLookupTable.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper.h>
#include <vtkProp.h>
#include <vtkSmartPointer.h>
#include <vtkTextActor.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "eval/scene/props.h"
#include "eval/scene/scene_view.h"

namespace trigpoint {

struct SceneView::Parts {
  const SceneModel& model;
  SceneStyle style;
  DisplayUnit unit;
  vtkRenderer* renderer = nullptr;  // to which it was added
  PointColour points_by = PointColour::kHeight;
  bool by_rank = false;
  PointFilter filter;
  std::vector<size_t> shown;                     // points that are drawn, indices into the model
  std::vector<std::array<uint8_t, 3>> rgb;       // of all of the model's points, or empty
  std::map<const vtkProp*, std::string> run_of;  // of props that are of one
  // Stands where the first of its runs that is shown has the station.
  struct StationLabel {
    vtkSmartPointer<vtkBillboardTextActor3D> label;
    std::vector<std::pair<std::string, Eigen::Vector3d>> places;  // by run
  };
  std::map<std::string, StationLabel> station_labels;
  std::set<std::string> hidden_runs;
  std::map<std::string, double> opacities;          // of layers that were given one
  std::vector<vtkSmartPointer<vtkProp>> scale_bar;  // of the layer "axes"
  double error_scale = 1;
  double extent_m = 10;  // longest side of the scene's box
  std::map<std::string, std::vector<vtkSmartPointer<vtkProp>>> layers;
  std::map<std::string, bool> visible;
  std::vector<vtkSmartPointer<vtkBillboardTextActor3D>> labels;  // of all layers
  bool moving = false;
  std::vector<std::pair<std::string, vtkSmartPointer<vtkTextActor>>> legend;  // by layer
  vtkSmartPointer<vtkActor> points;
  vtkSmartPointer<vtkProp> points_bar;
  vtkSmartPointer<vtkTextActor> bar_title;
  vtkSmartPointer<vtkPolyDataMapper> all_points, few_points;  // few: made when they are first asked for
  int few = 0;
  vtkSmartPointer<vtkLookupTable> point_colours;
  double lowest = 0, highest = 1;

  Parts(const SceneModel& m, const SceneStyle& s) : model(m), style(s) {}
  std::string Words(const std::string& english) const { return style.words ? style.words(english) : english; }
  void Add(const std::string& layer, vtkProp* prop, const std::string& run = "");
  bool IsOfHiddenRun(const vtkProp* prop) const;
  void PlaceBar(vtkRenderer* of) const;                      // its texts need their room in a small window, too
  void Fade(const std::string& layer, vtkProp* prop) const;  // as `opacities` has it
  void ShowLayer(const std::string& layer);                  // as `visible`, `hidden_runs` and `moving` have it
  void AddLabel(const std::string& layer, vtkBillboardTextActor3D* label);

  // Each fills the layers it is named after.
  void BuildPaths();
  void BuildPoints();
  void BuildCameras();
  void BuildPanoramas();
  void BuildStationLabels();
  void PlaceStationLabels();  // as `hidden_runs` has it
  void BuildTags();
  double ChooseScale(double radius) const;  // `radius` of an ellipsoid in sigmas
  void BuildErrors();
  void BuildControl();
  void BuildEllipsoids();  // of tags and cameras, at the scale of errors
  void BuildGround();      // aerial, axes, north arrow
  void BuildScaleBar();    // in the unit shown, in place of the one there is
  double ScaleBarLength() const;
  void BuildLegend();
  void PlaceLegend();  // one line below the other, of the layers that are drawn
  void ColourPoints();
  void ChoosePoints();  // those that pass, of runs that are shown
  void ThinPoints(int most);
  void DrawColoured(vtkPolyDataMapper* mapper, vtkDataArray* values) const;
  double ValueOf(const ScenePoint& point) const;  // that colours it
};

constexpr double kVeil = 0.14;  // opacity of an ellipsoid
inline constexpr Colour kCameraBlue = {0.35, 0.55, 0.75};

// The layer a path belongs to.
const char* LayerOf(ScenePath::Kind kind);
// 1, 2 or 5 times a power of ten, the nearest at or below.
double RoundNumber(double value);
// "0.2", "50": as short as it can be said.
std::string ShortNumber(double value);

}  // namespace trigpoint
