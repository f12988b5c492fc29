// The scene in three dimensions: the report's own scene, with a mouse. Orbit, fly, plan; layers; picking; scrubbing
// along a run; measuring; stepping inside a panorama; screenshots.
#pragma once

#include <Eigen/Core>
#include <QImage>
#include <QTimer>
#include <QWidget>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "app/desktop/workspace.h"
#include "eval/scene/scene_model.h"

class QCheckBox;
class QComboBox;
class QKeyEvent;
class QLabel;
class QListWidget;
class QPushButton;
class QSlider;
class QSpinBox;
class QDoubleSpinBox;
class QTabWidget;
class QToolButton;

namespace trigpoint {

class MeasurementList;
class PictureView;
class PlanOverlay;
class ScenePairs;
class ViewCube;
struct MeasuredPlace;
struct Measurement;
struct PlanFrame;
struct ScenePick;

class SceneDesk : public QWidget {
  Q_OBJECT

 public:
  enum class Kind { kFull, kCompact };  // compact: the view and little else, for two side by side
  explicit SceneDesk(Workspace* workspace, Kind kind = Kind::kFull, QWidget* parent = nullptr);
  ~SceneDesk() override;

  bool HasScene() const;
  // Objects that are highlighted now: the selected one and what belongs to it, as far as the scene has them.
  QStringList Highlighted() const;
  // Selects what lies under a pixel of the view (device pixels from its top left); returns its line of text.
  QString PickAt(double x, double y);
  // The errors drawn at a station or panorama; for tests.
  std::vector<SceneError> ErrorsAt(const QString& object) const;
  // Where an object of the scene is drawn, for tests and for jumping to it; negative: not in the scene.
  QPointF PlaceOf(const QString& object) const;
  // Whatever size the window has. Throws IoError.
  QImage Screenshot(int width, int height);
  bool StepInside(const QString& panorama);
  void StepOutside();
  bool inside() const;
  // Turns the view in steps, as dragging does, and shows each; returns the milliseconds of each.
  std::vector<double> Turn(int steps);
  // Other results than the chosen variant's of the opened project; one run's alone if `run` isn't empty.
  void ShowResults(const SceneSource& source, const QString& run);
  // Both views are turned and moved together from now on.
  void ShareCamera(SceneDesk* other);
  // What keeps this scene and another under one camera from lying over each other, in a sentence; empty: nothing.
  QString DiffersFrom(const SceneDesk& other) const;
  // An object and what belongs to it, in the direction one looks now; as soon as the scene is there.
  void LookAt(const QString& object);
  // "orbit", "fly", "plan".
  void SetMode(const QString& mode);
  QString mode() const;
  // What the wheel does at a pixel of the view (device pixels from its top left): it stays where it is.
  void ZoomAt(const QPointF& at, double factor);
  MeasurementList* measurements() const { return measurements_; }
  ViewCube* cube() const { return cube_; }
  PlanOverlay* plan_overlay() const { return overlay_; }
  // Coordinates under the mouse, for the window's status bar; two side by side show their own.
  QLabel* place() const { return place_; }
  // From a side of the scene, as a click on the cube does; `from`: towards the viewer.
  void LookFrom(const Eigen::Vector3d& from);
  size_t PointsShown() const;
  size_t PointsDrawn() const;    // fewer of many while the view moves
  bool shades_by_depth() const;  // eye-dome lighting is on, as far as the view rests

 signals:
  void Loaded();                          // a scene is on the screen
  void SteppedInside();                   // the panorama is around the viewer
  void Activated(const QString& object);  // show its image

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;
  void showEvent(QShowEvent* event) override;
  void hideEvent(QHideEvent* event) override;
  void changeEvent(QEvent* event) override;

 private:
  struct Vtk;
  void MakeControls();
  void MakeView();
  void MakeLook();  // layers, runs, points: how it is drawn
  QTabWidget* ArrangeLook();
  void MakeInside();  // what is there inside a panorama
  void Arrange();
  void ConnectControls();
  void ConnectWorkspace();
  void Load();
  void ClearScene();  // what is drawn, until the next scene is there
  void Forget();      // and everything that is said of it: another project is opened
  void ShowLayers();
  void ShowSwatches();
  void ShowSelected();
  void ShowPicture();
  void ShowPointPicture(const std::string& name);
  void ShowCamera(int index);
  void FollowSlider();  // what is selected
  void ConnectLook();
  void UseStyle(const QString& mode);
  bool PressKey(QKeyEvent* event);
  bool LookFromKey(int key);
  void Hover(const QPointF& at);  // says where the mouse is
  void SayPlace(const QString& text);
  QString ObjectAt(const QPointF& at) const;  // device pixels; empty: none
  void ShowAll();
  void StepInto(size_t panorama);  // index into the model
  void StepBy(int by);             // to the next panorama of the run one stands in
  MeasuredPlace PlaceMeasured(const ScenePick& pick) const;
  QString MeasureTo(const ScenePick& pick);  // returns what it says
  void SolveMeasured();
  QString ShowMeasured();  // in the unit shown
  void ForgetMeasured();   // what is drawn of it
  void SaveMeasurements();
  void ShowOpacity();
  void SetOpacity(int percent);  // of the chosen layer
  void DrawAsSet();              // opacities, points and runs, in a scene that is new
  void ShowRuns();
  void ShowFilterUnit();
  void ForgetLook();     // runs, filters and opacities of another project
  void FetchRgb();       // of the pictures, for points in their colours
  void ShowOverlays();   // as the camera stands
  void PlaceOverlays();  // and shows those that belong to the mode
  bool IsChecked(const QString& layer) const;
  PlanFrame PlanOf() const;
  void ListInside();  // runs that have the panorama one stands in
  void Render();
  void RenderAtOnce();             // of many points some, until nothing else happens
  void Say(const QString& text);   // of the selection
  void Note(const QString& text);  // of what was done last, below what is to be known of the scene
  void ShowBackground();

  Workspace* workspace_;
  std::unique_ptr<Vtk> vtk_;
  QComboBox *mode_, *colour_, *variant_, *run_;
  QListWidget* layers_;
  QCheckBox *follow_, *measure_;
  QPushButton *step_, *screenshot_;
  QSlider *time_, *opacity_, *size_;
  QListWidget* runs_;
  QCheckBox *percentiles_, *edl_;
  QSpinBox* least_images_;
  QDoubleSpinBox *most_sigma_, *most_residual_;
  QLabel* points_shown_;
  QComboBox* inside_run_;
  QToolButton *previous_, *next_;
  ViewCube* cube_ = nullptr;
  PlanOverlay* overlay_ = nullptr;
  QLabel *text_, *note_, *camera_, *place_;
  QString load_notes_;
  MeasurementList* measurements_;
  std::unique_ptr<MeasuredPlace> measured_from_;
  std::unique_ptr<Measurement> measured_;  // whose line is drawn
  std::shared_ptr<ScenePairs> pairs_;      // of the scene that is shown, while one measures
  std::map<std::string, int> opacities_;   // percent, by layer; others are 100
  double filter_unit_m_ = 1;               // in which a filter's length stands
  PictureView* picture_;
  QPointF pressed_;
  QTimer rest_;  // until all points are drawn
  SceneDesk* twin_ = nullptr;
  Kind kind_;
  std::optional<SceneSource> source_;  // nothing: the opened project's, with the chosen variant
  QString only_run_, look_at_;
  std::shared_ptr<const Snapshot> shown_from_;
  std::optional<size_t> stepping_;  // the panorama that is being read, to step into it
  bool picturing_ = false;          // what is rendered is a picture to be saved
  bool stale_ = false;              // to be loaded when it is seen
  int generation_ = 0;
  int shown_ = 0;  // selections so far
};

}  // namespace trigpoint
