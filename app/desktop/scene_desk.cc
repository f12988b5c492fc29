#include "app/desktop/scene_desk.h"

#include <vtkCallbackCommand.h>
#include <vtkCamera.h>
#include <vtkRenderWindowInteractor.h>

#include <QApplication>
#include <QCheckBox>
#include <QComboBox>
#include <QElapsedTimer>
#include <QEvent>
#include <QFileDialog>
#include <QFormLayout>
#include <QInputDialog>
#include <QLabel>
#include <QListWidget>
#include <QPainter>
#include <QPushButton>
#include <QSlider>
#include <QSpinBox>
#include <QTabWidget>
#include <QToolButton>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "app/desktop/background.h"
#include "app/desktop/inspector.h"
#include "app/desktop/measurement.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/pictures.h"
#include "app/desktop/report_text.h"
#include "app/desktop/scene_overlay.h"
#include "app/desktop/scene_styles.h"
#include "app/desktop/scene_vtk.h"
#include "app/desktop/widgets.h"
#include "calib/base/error.h"
#include "calib/base/memory.h"
#include "datasets/io/image.h"
#include "datasets/io/text.h"
#include "datasets/project/files.h"
#include "eval/scene/scene_pairs.h"

namespace trigpoint {

namespace {

constexpr int kMostPoints = 1000000;
constexpr int kRest_ms = 250;
constexpr int kMostCameras = 2000;
constexpr size_t kMostTextures = 40;  // panoramas drawn with their pictures; with more they are plain
constexpr int kMostNames = 8;         // images listed of a point
constexpr int kMostLabels = 500;      // of stations, and of tags
constexpr int kSkyWidth = 4096;       // px, of the panorama one stands in

std::string ObjectOf(const ScenePick& pick) {
  if (pick.layer == "cameras") return "image:" + pick.run + "/" + pick.name;
  if (pick.layer == "panoramas" || pick.layer == "geotags" || pick.layer == "errors" || pick.layer == "ellipsoids") {
    return "panorama:" + pick.name;
  }
  if (pick.layer == "tags") return "tag:" + pick.name;
  if (pick.layer == "control") return "control:" + pick.name;
  if (pick.layer == "points") return "point:" + pick.run + "/" + pick.name;
  return "";
}

// A release keeps the origin that its results were computed with.
std::optional<LocalFrame> FrameOf(const Project& project, const std::string& release) {
  if (!release.empty()) {
    const auto record = ReadJsonOrNothing(project.dir() / "releases" / release / "release.json");
    const auto origin = record.find("origin");
    if (origin != record.end() && origin->is_array() && origin->size() == 3) {
      return LocalFrame({(*origin)[0].get<double>(), (*origin)[1].get<double>(), (*origin)[2].get<double>()});
    }
  }
  return project.has_frame() ? std::make_optional(project.frame()) : std::nullopt;
}

std::shared_ptr<const LoadedScene> LoadAll(const Project& project, const SceneOptions& options) {
  const auto scene = std::make_shared<LoadedScene>();
  scene->model = LoadScene(project, options);
  ReturnFreeMemory();  // of the sparse models, before the points are drawn
  if (!scene->model.on_earth) return scene;
  scene->frame = FrameOf(project, options.release);
  try {
    if (scene->frame && !project.crs().empty())
      scene->crs = std::make_shared<const Crs>(Crs::Named(project.crs(), scene->frame->origin()));
  } catch (const Error&) {  // needs PROJ, which isn't there; or is said elsewhere to be wrong
  }
  return scene;
}

// The names of the layers, for lupdate, which finds no string that is put together elsewhere.
[[maybe_unused]] constexpr const char* kLayerNames[] = {
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "aerial"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "odometry"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "optimised"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "truth"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "reference"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "estimates"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "points"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "cameras"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "panoramas"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "geotags"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "tags"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "errors"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "ellipsoids"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "labels"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "axes"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "legend"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "gps"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "control"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "tag ellipsoids"),
    QT_TRANSLATE_NOOP("trigpoint::SceneDesk", "camera ellipsoids"),
};

}  // namespace

SceneDesk::SceneDesk(Workspace* workspace, Kind kind, QWidget* parent)
    : QWidget(parent), workspace_(workspace), vtk_(std::make_unique<Vtk>()), kind_(kind) {
  MakeControls();
  MakeView();
  Arrange();
  ConnectControls();
  ConnectLook();
  ConnectWorkspace();
}

void SceneDesk::MakeControls() {
  mode_ = Named(new QComboBox, "scene.mode", tr("How the mouse moves the view"));
  mode_->addItem(tr("orbit"), "orbit");
  mode_->addItem(tr("fly"), "fly");
  mode_->addItem(tr("plan"), "plan");
  colour_ = Named(new QComboBox, "scene.colour", tr("Colour of the points"));
  colour_->addItem(tr("points by height"), static_cast<int>(PointColour::kHeight));
  colour_->addItem(tr("points by track length"), static_cast<int>(PointColour::kTrackLength));
  colour_->addItem(tr("points by uncertainty"), static_cast<int>(PointColour::kUncertainty));
  colour_->addItem(tr("points by residual"), static_cast<int>(PointColour::kResidual));
  colour_->addItem(tr("points as in the pictures"), static_cast<int>(PointColour::kPicture));
  variant_ = Named(new QComboBox, "scene.variant", tr("Variant"));
  run_ = Named(new QComboBox, "scene.run", tr("Run to move along"));
  layers_ = Named(new QListWidget, "scene.layers", tr("Layers"));
  follow_ = MakeCheckBox("scene.follow", tr("follow camera"));
  measure_ =
      MakeCheckBox("scene.measure", tr("measure"), tr("Two clicks on things of the scene: the distance between them"));
  step_ = MakeButton("scene.inside", tr("Step &inside"),
                     tr("Stand in the selected panorama and see points and tags drawn over it"));
  screenshot_ = MakeButton("scene.screenshot", tr("Screen&shot ..."));
  time_ = Named(new QSlider(Qt::Horizontal), "scene.time", tr("Place along the run"));
  text_ = Selectable(WrappedLabel("scene.text"));
  note_ = Selectable(Named(new QLabel, "scene.note", tr("Notes on the scene")));
  note_->setWordWrap(true);
  note_->hide();
  camera_ = new QLabel;
  place_ = Selectable(Named(new QLabel, "scene.place", tr("Coordinates under the mouse"),
                            tr("On the ground under the mouse; Ctrl+C in the view copies it")));
  place_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  measurements_ = new MeasurementList(workspace_);
  picture_ = Named(new PictureView, "", tr("Image of what is picked"));
  MakeLook();
  MakeInside();
}

void SceneDesk::MakeView() {
  vtk_->widget = Named(new QVTKOpenGLNativeWidget, "scene.view", tr("Scene"));
  vtk_->widget->setFocusPolicy(Qt::StrongFocus);
  vtk_->widget->setRenderWindow(vtk_->window);
  vtk_->window->SetNumberOfLayers(2);
  vtk_->window->SetMultiSamples(0);
  vtk_->sky->SetLayer(0);
  vtk_->sky->SetBackground(1, 1, 1);
  vtk_->sky->InteractiveOff();
  vtk_->window->AddRenderer(vtk_->renderer);
  vtkNew<vtkCallbackCommand> sync;
  sync->SetClientData(vtk_.get());
  sync->SetCallback([](vtkObject*, unsigned long, void* vtk, void*) { static_cast<Vtk*>(vtk)->SyncSky(); });
  vtk_->sky->AddObserver(vtkCommand::StartEvent, sync);
  vtkNew<vtkCallbackCommand> moved;
  moved->SetClientData(this);
  moved->SetCallback([](vtkObject*, unsigned long, void* desk, void*) {
    const SceneDesk* twin = static_cast<SceneDesk*>(desk)->twin_;
    if (twin != nullptr && twin->isVisible()) twin->vtk_->window->Render();
  });
  vtk_->window->GetInteractor()->AddObserver(vtkCommand::InteractionEvent, moved);
  // Fewer points while the view moves.
  vtkNew<vtkCallbackCommand> detail;
  detail->SetClientData(vtk_.get());
  detail->SetCallback([](vtkObject*, unsigned long event, void* parts, void*) {
    auto* vtk = static_cast<Vtk*>(parts);
    vtk->dragged = event == vtkCommand::StartInteractionEvent;
    vtk->DrawMoving(vtk->dragged);
    if (event == vtkCommand::EndInteractionEvent) vtk->window->Render();
  });
  vtk_->detail = detail;
  rest_.setSingleShot(true);
  rest_.setInterval(kRest_ms);
  connect(&rest_, &QTimer::timeout, this, [this] {
    if (vtk_->dragged) return;  // its end draws them
    vtk_->DrawMoving(false);
    Render();
  });
  vtk_->widget->installEventFilter(this);
  cube_ = new ViewCube(vtk_->widget);
  overlay_ = new PlanOverlay(vtk_->widget);
  connect(cube_, &ViewCube::Chosen, this, &SceneDesk::LookFrom);
  vtkNew<vtkCallbackCommand> drawn;  // before each picture
  drawn->SetClientData(this);
  drawn->SetCallback(
      [](vtkObject*, unsigned long, void* desk, void*) { static_cast<SceneDesk*>(desk)->ShowOverlays(); });
  vtk_->renderer->AddObserver(vtkCommand::StartEvent, drawn);
  SetMode("orbit");
}

void SceneDesk::Arrange() {
  auto* panel = Pane({{ArrangeLook(), 3}, text_, note_, {picture_, 2}});
  auto* save = MakeButton("scene.save_measurements", tr("Save m&easurements ..."),
                          tr("The list of measurements with their sigmas, as CSV"));
  save->hide();
  connect(save, &QPushButton::clicked, this, &SceneDesk::SaveMeasurements);
  connect(measurements_, &MeasurementList::Filled, save, &QWidget::setVisible);
  auto* top = InFlow({mode_, variant_, measure_, save, edl_, step_, previous_, next_, inside_run_, screenshot_});
  auto* bottom = InRow({run_, {time_, 1}, camera_, follow_});
  auto* middle = new QWidget;
  auto* rows = InColumn({top, {vtk_->widget, 1}}, middle);
  rows->setContentsMargins(0, 0, 0, 0);
  if (kind_ == Kind::kCompact) rows->addWidget(place_);
  rows->addLayout(bottom);
  rows->addWidget(measurements_);
  measurements_->setMaximumHeight(6 * fontMetrics().height() + 20);
  auto* split = InSplitter(Qt::Horizontal, {middle, panel}, {800, 220});
  split->setStretchFactor(0, 1);
  auto* all = InColumn({split}, this);
  if (kind_ == Kind::kCompact) {
    top->addWidget(colour_);
    panel->hide();
    all->setContentsMargins(0, 0, 0, 0);
    for (QWidget* w :
         std::initializer_list<QWidget*>{variant_, measure_, edl_, step_, screenshot_, run_, time_, follow_}) {
      w->hide();
    }
  }
}

void SceneDesk::ConnectControls() {
  connect(mode_, QOverload<int>::of(&QComboBox::activated), this, [this] { SetMode(mode_->currentData().toString()); });
  connect(variant_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &SceneDesk::Load);
  connect(layers_, &QListWidget::itemChanged, this, [this](QListWidgetItem* item) {
    if (!vtk_->view) return;
    vtk_->view->SetVisible(item->data(Qt::UserRole).toString().toStdString(), item->checkState() == Qt::Checked);
    Render();
  });
  connect(run_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, [this] {
    vtk_->cameras.clear();
    const SceneModel* model = vtk_->model();
    for (size_t i = 0; model != nullptr && i < model->cameras.size(); ++i) {
      if (Text(model->cameras[i].run) == run_->currentText()) {
        vtk_->cameras.push_back(static_cast<int>(i));
      }
    }
    time_->setRange(0, std::max(0, static_cast<int>(vtk_->cameras.size()) - 1));
  });
  connect(time_, &QSlider::valueChanged, this, &SceneDesk::ShowCamera);
  connect(follow_, &QCheckBox::toggled, this, [this] { ShowCamera(time_->value()); });
  connect(measure_, &QCheckBox::toggled, this, [this](bool on) {
    measured_from_.reset();
    if (!on) ForgetMeasured();
    pairs_ = std::make_shared<ScenePairs>();
    if (!on) Note("");
    Render();
  });
  connect(step_, &QPushButton::clicked, this, [this] {
    if (inside()) return StepOutside();
    for (const std::string& object : workspace_->related()) {
      if (object.starts_with("panorama:") && StepInside(Text(object.substr(9)))) return;
    }
    Note(tr("Select a localized panorama first."));
  });
  connect(screenshot_, &QPushButton::clicked, this, [this] {
    bool ok = false;
    const QString size = QInputDialog::getText(this, tr("Screenshot"), tr("Width x height, pixels"), QLineEdit::Normal,
                                               "1920x1080", &ok);
    if (!ok) return;
    const int width = size.section('x', 0, 0).toInt(), height = size.section('x', 1, 1).toInt();
    if (width < 1 || height < 1 || width > 16384 || height > 16384) {
      emit workspace_->Problem(tr("'%1' is no size; expected something like 1920x1080").arg(size), "");
      return;
    }
    const QString file = QFileDialog::getSaveFileName(this, tr("Save the screenshot"), "scene.png", "PNG (*.png)");
    if (file.isEmpty()) return;
    if (!Screenshot(width, height).save(file)) emit workspace_->Problem(tr("%1: cannot be written").arg(file), "");
  });
}

void SceneDesk::ConnectWorkspace() {
  connect(workspace_, &Workspace::Opened, this, [this] {
    {
      const QSignalBlocker block(variant_);
      const QString before = variant_->currentData().toString();
      variant_->clear();
      for (const std::string& name : workspace_->snapshot()->variants) {
        variant_->addItem(name.empty() ? tr("first results") : Text(name), Text(name));
      }
      variant_->setCurrentIndex(std::max(0, variant_->findData(before)));
      variant_->setVisible(kind_ == Kind::kFull && variant_->count() > 1);
    }
    if (kind_ == Kind::kFull) Load();  // the others are told which results to show
  });
  connect(workspace_, &Workspace::Replaced, this, &SceneDesk::Forget);
  connect(workspace_, &Workspace::Selected, this, &SceneDesk::ShowSelected);
  connect(workspace_, &Workspace::UnitChanged, this, &SceneDesk::ShowSelected);
  connect(workspace_, &Workspace::UnitChanged, this, &SceneDesk::ShowMeasured);
  connect(workspace_, &Workspace::UnitChanged, this, [this] { SayPlace(""); });  // until the mouse moves again
}

void SceneDesk::ConnectLook() {
  vtk_->widget->setMouseTracking(true);
  connect(layers_, &QListWidget::currentRowChanged, this, &SceneDesk::ShowOpacity);
  connect(opacity_, &QSlider::valueChanged, this, &SceneDesk::SetOpacity);
  const auto draw = [this] {
    DrawAsSet();
    Render();
  };
  connect(size_, &QSlider::valueChanged, this, draw);
  connect(colour_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, draw);
  connect(colour_, QOverload<int>::of(&QComboBox::currentIndexChanged), this, &SceneDesk::FetchRgb);
  connect(percentiles_, &QCheckBox::toggled, this, draw);
  connect(least_images_, QOverload<int>::of(&QSpinBox::valueChanged), this, draw);
  connect(most_sigma_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, draw);
  connect(most_residual_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, draw);
  connect(runs_, &QListWidget::itemChanged, this, draw);
  connect(edl_, &QCheckBox::toggled, this, [this](bool on) {
    vtk_->ShadeByDepth(on && !inside());
    Render();
  });
  connect(workspace_, &Workspace::UnitChanged, this, &SceneDesk::ShowFilterUnit);
  connect(previous_, &QToolButton::clicked, this, [this] { StepBy(-1); });
  connect(next_, &QToolButton::clicked, this, [this] { StepBy(1); });
  connect(inside_run_, QOverload<int>::of(&QComboBox::activated), this,
          [this] { StepInto(static_cast<size_t>(inside_run_->currentData().toInt())); });
  connect(measurements_, &MeasurementList::SaveRequested, this, &SceneDesk::SaveMeasurements);
  connect(measurements_, &MeasurementList::ClearRequested, this, [this] {
    measurements_->Clear();
    ForgetMeasured();
    Render();
  });
}

SceneDesk::~SceneDesk() {
  vtk_->widget->makeCurrent();  // what VTK holds on the graphics card goes while its context is current
  vtk_->Clear(vtk_->highlights);
  vtk_->Clear(vtk_->measure);
  vtk_->HideSky();
  if (vtk_->view) vtk_->view->RemoveFrom(vtk_->renderer);
  vtk_->view.reset();
  vtk_->ShadeByDepth(false);
  vtk_->sky->RemoveAllObservers();
  vtk_->renderer->RemoveAllObservers();
  vtk_->window->GetInteractor()->RemoveObservers(vtkCommand::InteractionEvent);
}

bool SceneDesk::HasScene() const { return vtk_->view != nullptr; }
QStringList SceneDesk::Highlighted() const { return vtk_->highlighted; }
bool SceneDesk::inside() const { return vtk_->sphere != nullptr; }

void SceneDesk::hideEvent(QHideEvent* event) {
  QWidget::hideEvent(event);
  SayPlace("");
}

void SceneDesk::showEvent(QShowEvent* event) {
  QWidget::showEvent(event);
  if (stale_) return Load();
  if (vtk_->view) Render();  // what was selected on other desks meanwhile
}

void SceneDesk::changeEvent(QEvent* event) {
  QWidget::changeEvent(event);
  if (event->type() != QEvent::PaletteChange && event->type() != QEvent::StyleChange) return;
  ShowBackground();
  ShowSwatches();
  Render();
}

void SceneDesk::ShowBackground() {
  // Grey in the dark theme: the truth's line is black and the scale bar black and white in both.
  const double grey = palette().color(QPalette::Window).lightness() < 128 ? 0.36 : 1;
  vtk_->renderer->SetBackground(grey, grey, grey);
}

void SceneDesk::ShowResults(const SceneSource& source, const QString& run) {
  if (source_ == source && only_run_ == run && shown_from_ == workspace_->snapshot()) return;
  source_ = source;
  only_run_ = run;
  shown_from_ = workspace_->snapshot();
  Load();
}

void SceneDesk::ShareCamera(SceneDesk* other) {
  if (twin_ == other) return;
  twin_ = other;
  other->twin_ = this;
  vtk_->renderer->SetActiveCamera(other->vtk_->renderer->GetActiveCamera());
}

void SceneDesk::Load() {
  // Two views of a million points are made when they are looked at, not before.
  stale_ = workspace_->snapshot() && !isVisible();
  if (stale_) return;
  const int generation = ++generation_;
  if (!workspace_->snapshot()) return Forget();
  const SceneSource source =
      source_.value_or(SceneSource{workspace_->snapshot()->dir, variant_->currentData().toString().toStdString(), ""});
  // Everything but the points is there at once; these follow.
  for (const int points : {0, kMostPoints}) {
    InBackground(
        this,
        [snapshot = workspace_->snapshot(), source, run = only_run_.toStdString(), points] {
          SceneOptions options;
          if (!run.empty()) options.runs = {run};
          options.variant = source.variant;
          options.release = source.release;
          options.max_points = points;
          options.max_cameras = kMostCameras;
          if (points == 0) options.aerial_px = 0;
          if (points == 0 || snapshot->references.size() > kMostTextures) options.panorama_width_px = 0;
          std::vector<std::string> problems;
          return source.project == snapshot->dir ? LoadAll(*snapshot->project, options)
                                                 : LoadAll(Project::OpenTolerant(source.project, &problems), options);
        },
        [this, generation, points](const Attempted<std::shared_ptr<const LoadedScene>>& loaded) {
          if (generation != generation_) return;
          if (!loaded.value) {
            emit workspace_->Problem(loaded.error, tr("The scene is not shown."));
            return;
          }
          if (points == 0 && vtk_->scene && !vtk_->scene->model.points.empty() && vtk_->looked) return;
          ClearScene();
          vtk_->scene = loaded.value;
          SceneStyle style;
          style.text_px = 0.85 * fontMetrics().height() * devicePixelRatioF();
          style.max_labels = kMostLabels;  // those that have room are drawn
          style.words = [](const std::string& english) { return ReportText(english).toStdString(); };
          // Two that stand side by side are drawn at one scale, in the same colours.
          if (twin_ != nullptr && twin_->vtk_->view) {
            style.error_scale = twin_->vtk_->view->ErrorScale();
            style.heights_m = twin_->vtk_->view->HeightsOfColours();
          }
          vtk_->view = std::make_unique<SceneView>(vtk_->scene->model, style);
          vtk_->view->AddTo(vtk_->renderer);
          ShowBackground();
          ShowLayers();  // before anything is drawn: axes go by the list
          if (!vtk_->looked) {
            ShowAll();
            vtk_->looked = !vtk_->scene->model.Empty();
          }
          QStringList notes;
          for (const std::string& note : vtk_->scene->model.notes) notes << Text(note);
          if (vtk_->scene->model.Empty()) notes.prepend(tr("Nothing to show yet: run localize."));
          load_notes_ = notes.join("\n");
          ShowSelected();
          if (!look_at_.isEmpty()) LookAt(std::exchange(look_at_, QString()));
          Render();
          FetchRgb();
          emit Loaded();
        });
  }
}

void SceneDesk::ClearScene() {
  vtk_->widget->makeCurrent();
  vtk_->Clear(vtk_->highlights);
  ForgetMeasured();
  pairs_ = std::make_shared<ScenePairs>();
  stepping_.reset();
  vtk_->highlighted.clear();
  if (inside()) UseStyle(mode());
  vtk_->HideSky();
  step_->setText(tr("Step &inside"));
  ListInside();
  if (vtk_->view) vtk_->view->RemoveFrom(vtk_->renderer);
  vtk_->view.reset();
  vtk_->scene.reset();
}

void SceneDesk::Forget() {
  ++generation_;
  ++shown_;
  ClearScene();
  stale_ = false;
  look_at_.clear();
  vtk_->looked = false;
  vtk_->cameras.clear();
  source_.reset();
  shown_from_.reset();
  const QSignalBlocker block_run(run_), block_time(time_);
  layers_->clear();
  ForgetLook();
  run_->clear();
  time_->setRange(0, 0);
  camera_->clear();
  SayPlace("");
  measurements_->Clear();
  picture_->SetMarks({});
  picture_->SetPicture({}, "");
  load_notes_ = workspace_->snapshot() ? QString() : tr("Open a project (Ctrl+O): its scene is drawn here.");
  Note("");
  Say("");
  Render();
}

// Of the layers, in an outline that is seen on every background: some are as dark as the list in the dark theme.
void SceneDesk::ShowSwatches() {
  const QSignalBlocker block(layers_);
  for (int i = 0; i < layers_->count(); ++i) {
    const QString layer = layers_->item(i)->data(Qt::UserRole).toString();
    const QColor colour(Text(SceneView::ColourOfLayer(layer.toStdString())));
    if (!colour.isValid()) continue;
    QPixmap swatch(12, 12);
    swatch.fill(palette().color(QPalette::Text));
    QPainter(&swatch).fillRect(QRect(1, 1, 10, 10), colour);
    layers_->item(i)->setIcon(swatch);
  }
}

void SceneDesk::ShowLayers() {
  const QSignalBlocker block(layers_);
  std::map<QString, bool> shown;
  for (int i = 0; i < layers_->count(); ++i) {
    shown[layers_->item(i)->data(Qt::UserRole).toString()] = layers_->item(i)->checkState() == Qt::Checked;
  }
  layers_->clear();
  for (const std::string& layer : SceneView::Layers()) {
    if (!vtk_->view->HasContent(layer)) continue;
    const QString name = Text(layer);
    auto* item = new QListWidgetItem(tr(layer.c_str()), layers_);
    item->setData(Qt::UserRole, name);
    item->setFlags(item->flags() | Qt::ItemIsUserCheckable);
    const auto before = shown.find(name);
    const bool on = before == shown.end() ? vtk_->view->Visible(layer) : before->second;
    item->setCheckState(on ? Qt::Checked : Qt::Unchecked);
    vtk_->view->SetVisible(layer, on);
  }
  ShowSwatches();
  ShowRuns();
  PlaceOverlays();
  cube_->SetOnEarth(vtk_->scene->model.on_earth);
  DrawAsSet();
  const QString run = run_->currentText();
  const QSignalBlocker block_run(run_);
  run_->clear();
  for (const std::string& name : vtk_->scene->model.runs) run_->addItem(Text(name));
  run_->setCurrentIndex(-1);
  run_->blockSignals(false);
  run_->setCurrentIndex(std::max(0, run_->findText(run)));
}

void SceneDesk::ShowSelected() {
  ++shown_;
  vtk_->Clear(vtk_->highlights);
  vtk_->highlighted.clear();
  if (!vtk_->view) return;
  Note("");  // what was done before is of another selection
  vtk_->view->SetUnit(workspace_->display_unit());
  QStringList texts;
  for (const std::string& object : workspace_->related()) {
    const std::vector<ScenePick> found = vtk_->Find(object);
    if (found.empty()) continue;
    vtk_->highlighted << Text(object);
    const bool small = object.starts_with("image:") || object.starts_with("point:");
    for (const ScenePick& pick : found) {
      // From inside a panorama the ring of its own mark would surround the viewer.
      const bool own =
          inside() && pick.layer == "panoramas" && pick.name == vtk_->scene->model.panoramas[vtk_->inside].panorama;
      if (pick.layer != "errors" && !own) vtk_->AddRing(vtk_->highlights, pick.position, small ? 0.5 : 0.9);
      const QString text = Text(pick.text);
      if (pick.layer != "errors" && !texts.contains(text)) texts << text;  // errors stand on the station's card
    }
  }
  texts.sort();
  if (!texts.isEmpty()) texts << tr("frame: %1").arg(Text(vtk_->scene->model.frame));
  const QString& selected = workspace_->selected();
  const bool there = selected.isEmpty() || !vtk_->Find(selected.toStdString()).empty();
  // A tag or control point stands in for a station that isn't localized; a detection is its image and its tag.
  if (!there && texts.isEmpty()) texts << tr("%1 is not in the scene.").arg(selected);
  if (!there && !selected.startsWith("detection:") && vtk_->highlighted.size() > 0)
    texts.prepend(tr("%1 is not in the scene; what belongs to it is:").arg(selected));
  Say(texts.join("\n"));
  RenderAtOnce();
  ShowPicture();
  FollowSlider();
}

void SceneDesk::ShowPicture() {
  if (kind_ == Kind::kCompact) return;  // has no place for it
  const std::string selected = workspace_->selected().toStdString();
  if (selected.starts_with("point:")) return ShowPointPicture(selected.substr(6));
  for (const std::string& object : workspace_->related()) {
    if (!object.starts_with("image:") && !object.starts_with("panorama:")) continue;
    InBackground(
        this,
        [snapshot = workspace_->snapshot(), object]() -> QImage {
          const std::string name = object.substr(object.find(':') + 1);
          if (object.starts_with("image:")) {
            return LoadRunPicture(*snapshot->project, name.substr(0, name.find('/')), name.substr(name.find('/') + 1));
          }
          for (const SnapshotReference& reference : snapshot->references) {
            if (reference.name == name && !reference.files.empty())
              return LoadAnyPicture(reference.files.front(), 1024);
          }
          return {};
        },
        [this, object, selection = shown_](const Attempted<QImage>& image) {
          if (selection != shown_) return;
          picture_->SetMarks({});
          picture_->SetPicture(image.value,
                               image.error.isEmpty() ? Text(object.substr(object.find(':') + 1)) : image.error);
        });
    return;
  }
  picture_->SetMarks({});
  picture_->SetPicture({}, "");
}

// The images that see the point, and the first of them with the point marked.
void SceneDesk::ShowPointPicture(const std::string& name) {
  const std::string run = name.substr(0, name.find('/'));
  const int64_t id = Text(name.substr(name.find('/') + 1)).toLongLong();
  struct Seen {
    std::vector<std::string> images;
    QImage picture;
    QPointF at;
  };
  std::shared_ptr<SharedInspector> inspector;
  try {
    inspector = workspace_->InspectorOf(run, variant_->currentData().toString().toStdString());
  } catch (const Error& e) {
    Say(QString::fromUtf8(e.what()));
    return;
  }
  InBackground(
      this,
      [snapshot = workspace_->snapshot(), inspector, run, id] {
        Seen seen;
        const std::lock_guard guard(inspector->mutex);
        seen.images = inspector->inspector.ImagesOf(id);
        if (seen.images.empty()) return seen;
        for (const InspectedPoint& point : inspector->inspector.Image(seen.images.front()).points) {
          if (point.id == id) seen.at = {point.seen.x(), point.seen.y()};
        }
        seen.picture = LoadRunPicture(*snapshot->project, run, seen.images.front());
        return seen;
      },
      [this, selection = shown_](const Attempted<Seen>& seen) {
        if (selection != shown_) return;
        if (seen.value.images.empty()) return Say(text_->text() + "\n" + seen.error);
        QStringList images;
        for (const std::string& image : seen.value.images) images << Text(image);
        const QString shown = images.front();
        if (images.size() > kMostNames) images = images.mid(0, kMostNames) << "...";
        Say(text_->text() + "\n" + tr("seen by %1").arg(images.join(", ")));
        picture_->SetPicture(seen.value.picture, shown);
        PictureMark mark;
        mark.kind = PictureMark::Kind::kCircle;
        mark.points << seen.value.at << QPointF(6, 0);
        mark.colour = QColor(213, 94, 0);
        picture_->SetMarks({mark});
      });
}

QString SceneDesk::PickAt(double x, double y) {
  const auto pick = vtk_->Pick({x, y});
  if (!pick) return "";
  if (measure_->isChecked()) return MeasureTo(*pick);
  const QString text = Text(pick->text);
  const std::string object = ObjectOf(*pick);
  if (!object.empty()) workspace_->Select(Text(object));  // says what belongs to it, too
  if (object.empty() || pick->layer == "errors") Note(text);
  return text;
}

QString SceneDesk::ObjectAt(const QPointF& at) const {
  const auto pick = vtk_->Pick(at);
  return pick ? Text(ObjectOf(*pick)) : QString();
}

std::vector<SceneError> SceneDesk::ErrorsAt(const QString& object) const {
  std::vector<SceneError> errors;
  const SceneModel* model = vtk_->model();
  if (model == nullptr) return errors;
  for (const SceneError& e : model->errors) {
    const std::string of = object.toStdString();
    if (of == "station:" + e.station || of == "panorama:" + e.panorama) errors.push_back(e);
  }
  return errors;
}

QPointF SceneDesk::PlaceOf(const QString& object) const {
  const std::vector<ScenePick> found = vtk_->Find(object.toStdString());
  if (found.empty()) return {-1, -1};
  const Eigen::Vector3d& at = found.front().position;
  vtk_->renderer->SetWorldPoint(at.x(), at.y(), at.z(), 1);
  vtk_->renderer->WorldToDisplay();
  const double* d = vtk_->renderer->GetDisplayPoint();
  return {d[0], vtk_->window->GetSize()[1] - 1 - d[1]};
}

QImage SceneDesk::Screenshot(int width, int height) {
  // What lies over the view is not in its picture: the scene's own scale and north are.
  picturing_ = true;
  const cv::Mat picture = vtk_->Picture(width, height);
  picturing_ = false;
  Render();
  return QImage(picture.data, picture.cols, picture.rows, static_cast<int>(picture.step), QImage::Format_RGB888).copy();
}

bool SceneDesk::StepInside(const QString& panorama) {
  const SceneModel* model = vtk_->model();
  for (size_t i = 0; model != nullptr && i < model->panoramas.size(); ++i) {
    const ScenePanorama& p = model->panoramas[i];
    if (p.panorama != panorama.toStdString() || p.file.empty() || p.kind != ReferenceKind::kPanorama) continue;
    StepInto(i);
    return true;
  }
  return false;
}

void SceneDesk::StepInto(size_t panorama) {
  stepping_ = panorama;
  InBackground(
      this,
      [file = vtk_->model()->panoramas[panorama].file]() -> cv::Mat {
        cv::Mat picture = LoadPanorama(file, false);
        if (picture.cols > kSkyWidth)
          cv::resize(picture.clone(), picture, {kSkyWidth, kSkyWidth / 2}, 0, 0, cv::INTER_AREA);
        return picture;
      },
      [this, panorama, generation = generation_](const Attempted<cv::Mat>& picture) {
        if (generation != generation_ || stepping_ != panorama) return;  // another one was asked for, or none any more
        stepping_.reset();
        if (!picture.error.isEmpty()) {
          emit workspace_->Problem(picture.error, tr("The panorama is not shown."));
          return;
        }
        const ScenePanorama& shown = vtk_->scene->model.panoramas[panorama];
        vtk_->widget->makeCurrent();
        vtk_->ShowSky(shown, picture.value);
        vtk_->inside = panorama;
        vtk_->ShadeByDepth(false);
        ListInside();
        // Over the picture only what is seen in it.
        for (const std::string& layer : SceneView::Layers()) {
          const bool over = layer == "points" || layer == "tags" || layer == "labels";
          if (!over) vtk_->view->SetVisible(layer, false);
        }
        UseStyle("inside");
        step_->setText(tr("Step &outside"));
        // The card and the other desks go along.
        const std::string object = "panorama:" + shown.panorama;
        if (workspace_->related().count(object) > 0) {
          ShowSelected();
        } else {
          workspace_->Select(Text(object));
        }
        Note(tr("inside %1, as localized by %2; drag to look around, wheel: zoom, Page Up and Page Down: the others")
                 .arg(Text(shown.panorama), Text(shown.run)));
        Render();
        emit SteppedInside();
      });
}

void SceneDesk::StepOutside() {
  stepping_.reset();
  vtk_->widget->makeCurrent();
  vtk_->HideSky();
  vtk_->ShadeByDepth(edl_->isChecked());
  step_->setText(tr("Step &inside"));
  ListInside();
  if (!vtk_->view) return;
  for (int i = 0; i < layers_->count(); ++i) {
    vtk_->view->SetVisible(layers_->item(i)->data(Qt::UserRole).toString().toStdString(),
                           layers_->item(i)->checkState() == Qt::Checked);
  }
  UseStyle(mode());
  ShowSelected();
}

std::vector<double> SceneDesk::Turn(int steps) {
  std::vector<double> frames_ms;
  if (!vtk_->view) return frames_ms;
  vtk_->dragged = true;
  vtk_->DrawMoving(true);
  for (int i = 0; i < steps; ++i) {
    QElapsedTimer timer;
    timer.start();
    vtk_->renderer->GetActiveCamera()->Azimuth(2);
    vtk_->renderer->ResetCameraClippingRange();
    vtk_->window->Render();
    QApplication::processEvents(QEventLoop::ExcludeUserInputEvents);  // until the widget shows it
    frames_ms.push_back(1e-6 * static_cast<double>(timer.nsecsElapsed()));
  }
  vtk_->dragged = false;
  vtk_->DrawMoving(false);
  Render();
  return frames_ms;
}

void SceneDesk::LookAt(const QString& object) {
  look_at_ = vtk_->view ? QString() : object;
  if (!vtk_->view || !workspace_->snapshot() || object.isEmpty()) return;
  Eigen::AlignedBox3d box;
  for (const std::string& related : workspace_->snapshot()->Related(object.toStdString())) {
    for (const ScenePick& pick : vtk_->Find(related)) box.extend(pick.position);
  }
  if (box.isEmpty()) return Note(tr("%1 is not in the scene.").arg(object));
  if (inside()) StepOutside();
  vtk_->Fit(box);
  Render();
}

QString SceneDesk::DiffersFrom(const SceneDesk& other) const {
  if (!vtk_->scene || !other.vtk_->scene) return "";
  const SceneModel &here = vtk_->scene->model, &there = other.vtk_->scene->model;
  if (here.Empty() || there.Empty()) return "";
  if (here.frame != there.frame) {
    return tr("The two are in different frames and do not lie over each other: %1, and %2.")
        .arg(Text(there.frame), Text(here.frame));
  }
  if (!vtk_->scene->frame || !other.vtk_->scene->frame) return "";
  const double off_m = vtk_->scene->frame->EnuFromGeodetic(other.vtk_->scene->frame->origin()).norm();
  if (off_m < 0.001) return "";
  return tr("The origins of the two are %1 apart: the same place is not drawn at the same place.")
      .arg(workspace_->Length(off_m));
}

void SceneDesk::UseStyle(const QString& mode) {
  const vtkSmartPointer<vtkInteractorStyle> style = MakeSceneStyle(mode.toStdString(), &vtk_->pivot);
  style->SetDefaultRenderer(vtk_->renderer);
  style->AddObserver(vtkCommand::StartInteractionEvent, vtk_->detail);
  style->AddObserver(vtkCommand::EndInteractionEvent, vtk_->detail);
  vtkRenderWindowInteractor* interactor = vtk_->window->GetInteractor();
  if (interactor != nullptr) interactor->SetInteractorStyle(style);
}

void SceneDesk::SetMode(const QString& mode) {
  mode_->setCurrentIndex(mode_->findData(mode));
  if (inside()) StepOutside();
  UseStyle(mode);
  PlaceOverlays();
  ShowAll();
  if (twin_ != nullptr && twin_->mode() != mode) twin_->SetMode(mode);  // one camera cannot be in two
}

void SceneDesk::ShowCamera(int index) {
  const SceneModel* model = vtk_->model();
  if (model == nullptr || index < 0 || index >= static_cast<int>(vtk_->cameras.size())) return;
  const SceneCamera& camera = model->cameras[static_cast<size_t>(vtk_->cameras[static_cast<size_t>(index)])];
  camera_->setText(Text(camera.image));
  workspace_->Select(Text("image:" + camera.run + "/" + camera.image));
  if (!follow_->isChecked() || inside()) return;  // one stands at the panorama's centre
  if (mode() == "plan") {
    const Eigen::Vector3d focus(vtk_->renderer->GetActiveCamera()->GetFocalPoint());
    const Eigen::Vector3d away = camera.world_from_cam.translation - focus;
    vtk_->Move({away.x(), away.y(), 0});
  } else {
    vtk_->LookThrough(camera);
  }
  Render();
}

void SceneDesk::Render() {
  if (vtk_->widget->isVisible()) vtk_->window->Render();
  if (twin_ != nullptr && twin_->vtk_->widget->isVisible()) twin_->vtk_->window->Render();
}

void SceneDesk::RenderAtOnce() {
  const bool many = vtk_->view && vtk_->view->PointsShown() > SceneView::kMovingPoints;
  if (!many || vtk_->dragged) return Render();
  vtk_->DrawMoving(true);
  Render();
  rest_.start();
}

void SceneDesk::Say(const QString& text) { text_->setText(text); }

void SceneDesk::Note(const QString& text) {
  note_->setText(load_notes_.isEmpty() || text.isEmpty() ? load_notes_ + text : load_notes_ + "\n" + text);
  note_->setVisible(!note_->text().isEmpty());
}

}  // namespace trigpoint
