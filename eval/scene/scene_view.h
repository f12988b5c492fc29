// A SceneModel as layers of a VTK renderer: the same for the report (offscreen) and the desktop (a widget).
//
//   SceneView view(model);
//   view.AddTo(renderer);
//   view.LookDown(renderer);
//   view.SetVisible("points", false);
//   if (const auto pick = view.Pick(renderer, x, y)) ...  // pick->layer, pick->index into the model's vector
//
// Not thread safe; build, change and destroy it in the thread that renders. The model must outlive it.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "eval/scene/scene_model.h"
#include "eval/text/display_unit.h"

class vtkRenderer;

namespace trigpoint {

// kPicture: as the pictures have it, once SetPointRgb was called; grey until then.
enum class PointColour { kHeight, kTrackLength, kUncertainty, kResidual, kPicture };

// Points that are drawn and picked; a value that isn't known passes.
struct PointFilter {
  int least_images = 0;
  double most_sigma_m = std::numeric_limits<double>::infinity();
  double most_residual_px = std::numeric_limits<double>::infinity();
  bool operator==(const PointFilter&) const = default;
  bool Passes(const ScenePoint& point) const {
    return point.track_length >= least_images && !(point.sigma_m > most_sigma_m) &&
           !(point.residual_px > most_residual_px);
  }
};

struct SceneStyle {
  PointColour points = PointColour::kHeight;
  double sphere_radius_m = 0.5;  // of panoramas
  double frustum_depth_m = 0.5;  // of cameras
  // Error vectors and ellipsoids are this much longer than life; 0: a round number that makes them visible.
  double error_scale = 0;
  // Heights at the ends of the points' colours, m; none: from the 2nd to the 95th percentile of the points shown.
  std::optional<std::array<double, 2>> heights_m;
  double confidence = 0.95;  // of ellipsoids
  double text_px = 18;       // height of labels
  int max_spheres = 300;     // textured ones; further answers are dots
  int max_labels = 80;       // station and tag labels of each kind; with more, none are drawn
  // Translates the texts of legend and colour bar; without it they are English.
  std::function<std::string(const std::string&)> words;
};

// What lies under a pixel.
struct ScenePick {
  std::string layer;  // one of SceneView::Layers()
  int index = -1;     // into the model's vector of that layer: paths, points, cameras, panoramas, tags, control, errors
  std::string run;    // empty where it is of no run
  std::string name;   // image, panorama, tag id, the point's number, or the path's source
  // Of the object, scene frame; of a path its nearest pose, of an error the end that was hit: reference or estimate.
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d drawn_at = Eigen::Vector3d::Zero();  // of an error's tip: enlarged
  std::optional<Eigen::Vector3d> sigma_m;              // of the position per axis, where it is given
  std::string text;                                    // one line for a person, with units and sigmas
};

class SceneView {
 public:
  explicit SceneView(const SceneModel& model, const SceneStyle& style = {});
  ~SceneView();
  SceneView(const SceneView&) = delete;
  SceneView& operator=(const SceneView&) = delete;

  // "aerial", "odometry", "optimised", "truth", "reference", "estimates", "gps", "points", "cameras", "panoramas",
  // "geotags", "tags", "control", "errors", "ellipsoids", "tag ellipsoids", "camera ellipsoids", "labels", "axes",
  // "legend": always all, those without content too.
  static const std::vector<std::string>& Layers();
  // What the site's pictures need not show is hidden until it is asked for: gps, ellipsoids of tags and cameras.
  static bool ShownAtFirst(const std::string& layer);
  bool HasContent(const std::string& layer) const;
  void SetVisible(const std::string& layer, bool visible);  // throws OptionError for an unknown layer
  bool Visible(const std::string& layer) const;
  // Everything of a run, on all layers; what is of no run stays.
  void SetRunVisible(const std::string& run, bool visible);
  // 0 to 1, of everything in a layer. Throws OptionError for an unknown layer.
  void SetOpacity(const std::string& layer, double opacity);
  void SetPointSize(double pixels);
  // "#rrggbb" a layer is drawn in; empty: it has no colour of its own.
  static std::string ColourOfLayer(const std::string& layer);

  // Adds every layer; a view belongs to one renderer at a time. Sets a plain background.
  void AddTo(vtkRenderer* renderer);
  void RemoveFrom(vtkRenderer* renderer);

  // `by_rank`: evenly by percentile, so that outliers do not take the colours of the others.
  void ColourPointsBy(PointColour colour, bool by_rank = false);
  void FilterPoints(const PointFilter& filter);
  size_t PointsShown() const;
  size_t PointsDrawn() const;  // of them, as the view moves or rests
  // Red, green and blue of every point of the model.
  void SetPointRgb(std::vector<std::array<uint8_t, 3>> rgb);
  // Labels that would lie on the legend or on others are left out: the first ones stay. For one picture of `renderer`.
  void MakeRoomForLabels(vtkRenderer* renderer) const;
  // Where the lines of the legend lie that are drawn: display coordinates, origin at the bottom left.
  std::vector<Eigen::AlignedBox2d> LegendBoxes(vtkRenderer* renderer) const;
  static constexpr int kMovingPoints = 100000;  // drawn while the view moves, of more
  // Draws less, so that a view that moves stays smooth without a graphics card: some of the points, evenly thinned, no
  // ellipsoids, and labels whose plates hide what is behind. `false`: everything again.
  void DrawMoving(bool moving);
  // Written beside every picture: "error vectors and ellipsoids x 20".
  double ErrorScale() const;
  // Heights at the ends of this view's colours, for SceneStyle::heights_m of another; none if points are not coloured
  // by height.
  std::optional<std::array<double, 2>> HeightsOfColours() const;

  // Cameras: straight down with north up (parallel), from the south-west above, and one station with its surroundings.
  void LookDown(vtkRenderer* renderer) const;
  void LookOblique(vtkRenderer* renderer) const;
  void LookAtStation(vtkRenderer* renderer, const std::string& station) const;  // throws InputError if unknown

  // Display coordinates of the renderer's window, origin at the bottom left. Only visible layers are picked.
  std::optional<ScenePick> Pick(vtkRenderer* renderer, double x, double y) const;
  // What an entry of the model's vectors is, in the words of a pick. Throws InputError for an index that the layer
  // doesn't have.
  ScenePick Describe(const std::string& layer, int index) const;
  // In which lengths are said; the model stays in metres.
  void SetUnit(const DisplayUnit& unit);

  struct Parts;  // VTK's side

 private:
  std::unique_ptr<Parts> parts_;
};

}  // namespace trigpoint
