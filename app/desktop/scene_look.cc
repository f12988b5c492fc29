// How the scene is drawn: layers, runs, points; the cube and the plan's grid over it; what is there inside a panorama.
#include <vtkCamera.h>

#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QFormLayout>
#include <QLabel>
#include <QListWidget>
#include <QSlider>
#include <QSpinBox>
#include <QTabWidget>
#include <QToolButton>
#include <cmath>

#include "app/desktop/background.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/scene_overlay.h"
#include "app/desktop/scene_vtk.h"
#include "app/desktop/widgets.h"
#include "calib/base/error.h"
#include "datasets/export/crs.h"

namespace trigpoint {

namespace {

constexpr int kOverlayMargin_px = 8;
constexpr double kAlmostAbove = 0.018;  // of the direction from above: north stays up

template <typename Widget>
Widget* Explained(Widget* widget, const char* name, const QString& meaning) {
  return Named(widget, name, meaning, meaning);
}

}  // namespace

void SceneDesk::MakeLook() {
  opacity_ = Explained(new QSlider(Qt::Horizontal), "scene.opacity", tr("Opacity of the chosen layer"));
  opacity_->setRange(5, 100);
  opacity_->setValue(100);
  opacity_->setEnabled(false);
  size_ = Explained(new QSlider(Qt::Horizontal), "scene.size", tr("Size of the points"));
  size_->setRange(1, 10);
  size_->setValue(2);
  runs_ = Explained(new QListWidget, "scene.runs", tr("Runs that are shown, on all layers"));
  percentiles_ = Explained(new QCheckBox(tr("by percentile")), "scene.percentiles",
                           tr("Spreads the colours evenly over the points, so that outliers do not use up the scale"));
  edl_ = Explained(new QCheckBox(tr("depth shading")), "scene.edl",
                   tr("Outlines what stands before something else (eye-dome lighting), while the view rests"));
  least_images_ = Explained(new QSpinBox, "scene.least_images", tr("Only points that at least so many images see"));
  least_images_->setRange(0, 1000);
  least_images_->setSpecialValueText(tr("any"));
  const auto most = [this](const char* name, const QString& meaning, int decimals) {
    auto* box = Explained(new QDoubleSpinBox, name, meaning);
    box->setDecimals(decimals);
    box->setRange(0, 1000);
    box->setSingleStep(decimals > 2 ? 0.01 : 0.25);
    box->setSpecialValueText(tr("any"));
    return box;
  };
  most_sigma_ =
      most("scene.most_sigma", tr("Only points whose 1 sigma (largest axis, cameras held) is at most this"), 3);
  most_residual_ =
      most("scene.most_residual", tr("Only points whose mean reprojection error is at most so many pixels"), 2);
  most_residual_->setSuffix(" px");
  points_shown_ = Named(new QLabel, "scene.points_shown");
  ShowFilterUnit();
}

void SceneDesk::MakeInside() {
  const auto button = [](const char* name, Qt::ArrowType arrow, const QString& meaning) {
    auto* b = Explained(new QToolButton, name, meaning);
    b->setArrowType(arrow);
    b->hide();
    return b;
  };
  previous_ = button("scene.previous", Qt::LeftArrow, tr("The run's previous panorama (Page Up)"));
  next_ = button("scene.next", Qt::RightArrow, tr("The run's next panorama (Page Down)"));
  inside_run_ = Explained(new QComboBox, "scene.inside_run", tr("The run by which this panorama is localized"));
  inside_run_->hide();
}

QTabWidget* SceneDesk::ArrangeLook() {
  auto* look = new QFormLayout;
  look->addRow(tr("opacity"), opacity_);
  auto* layers = Pane({{layers_, 1}, runs_, look});
  auto* points = new QWidget;
  auto* form = new QFormLayout(points);
  form->setContentsMargins(4, 4, 4, 4);
  form->setRowWrapPolicy(QFormLayout::WrapLongRows);
  if (kind_ == Kind::kFull) form->addRow(colour_);
  form->addRow(percentiles_);
  form->addRow(tr("size"), size_);
  form->addRow(tr("images, at least"), least_images_);
  form->addRow(QString::fromUtf8("\xcf\x83") + tr(", at most"), most_sigma_);
  form->addRow(tr("residual, at most"), most_residual_);
  form->addRow(points_shown_);
  if (kind_ == Kind::kFull) colour_->setSizeAdjustPolicy(QComboBox::AdjustToMinimumContentsLengthWithIcon);
  auto* tabs = Named(new QTabWidget, "scene.look", tr("How the scene is drawn"));
  tabs->addTab(layers, tr("Layers"));
  tabs->addTab(points, tr("Points"));
  return tabs;
}

void SceneDesk::ShowRuns() {
  const QSignalBlocker block(runs_);
  QStringList hidden;
  for (int i = 0; i < runs_->count(); ++i) {
    if (runs_->item(i)->checkState() != Qt::Checked) hidden << runs_->item(i)->text();
  }
  runs_->clear();
  for (const std::string& run : vtk_->scene->model.runs) {
    auto* item = new QListWidgetItem(Text(run), runs_);
    item->setFlags(item->flags() | Qt::ItemIsUserCheckable);
    item->setCheckState(hidden.contains(item->text()) ? Qt::Unchecked : Qt::Checked);
  }
  runs_->setVisible(runs_->count() > 1);
  runs_->setMaximumHeight((std::min(runs_->count(), 4) * (fontMetrics().height() + 6)) + 6);
}

void SceneDesk::ForgetLook() {
  const QSignalBlocker runs(runs_), opacity(opacity_), images(least_images_), sigma(most_sigma_),
      residual(most_residual_);
  runs_->clear();
  opacities_.clear();
  opacity_->setValue(100);
  least_images_->setValue(least_images_->minimum());
  most_sigma_->setValue(0);
  most_residual_->setValue(0);
}

void SceneDesk::ShowFilterUnit() {
  const QSignalBlocker block(most_sigma_);
  const double metres = workspace_->metres_per_unit();
  most_sigma_->setSuffix(" " + workspace_->unit());
  most_sigma_->setValue(most_sigma_->value() * std::exchange(filter_unit_m_, metres) / metres);
  DrawAsSet();
}

void SceneDesk::DrawAsSet() {
  if (!vtk_->view) return;
  for (const auto& [layer, percent] : opacities_) vtk_->view->SetOpacity(layer, 0.01 * percent);
  vtk_->view->SetPointSize(size_->value());
  vtk_->view->ColourPointsBy(static_cast<PointColour>(colour_->currentData().toInt()), percentiles_->isChecked());
  PointFilter filter;  // 0: any
  filter.least_images = least_images_->value();
  if (most_sigma_->value() > 0) filter.most_sigma_m = most_sigma_->value() * workspace_->metres_per_unit();
  if (most_residual_->value() > 0) filter.most_residual_px = most_residual_->value();
  vtk_->view->FilterPoints(filter);
  for (int i = 0; i < runs_->count(); ++i) {
    const bool shown = runs_->item(i)->checkState() == Qt::Checked;
    vtk_->view->SetRunVisible(runs_->item(i)->text().toStdString(), shown);
  }
  points_shown_->setText(tr("%1 of %2 points").arg(PointsShown()).arg(vtk_->scene->model.points.size()));
}

size_t SceneDesk::PointsShown() const { return vtk_->view ? vtk_->view->PointsShown() : 0; }
size_t SceneDesk::PointsDrawn() const { return vtk_->view ? vtk_->view->PointsDrawn() : 0; }

bool SceneDesk::shades_by_depth() const { return vtk_->renderer->GetPass() != nullptr; }

void SceneDesk::FetchRgb() {
  const bool wanted = static_cast<PointColour>(colour_->currentData().toInt()) == PointColour::kPicture;
  if (!wanted || !vtk_->scene || vtk_->rgb_of == vtk_->scene || vtk_->scene->model.points.empty()) return;
  vtk_->rgb_of = vtk_->scene;
  Note(tr("Reading the points' colours from the pictures ..."));
  InBackground(
      this,
      [scene = vtk_->scene] {
        ProgressSink silent;
        return PointColoursOf(scene->model, silent, {});
      },
      [this, scene = vtk_->scene](const Attempted<std::vector<std::array<uint8_t, 3>>>& colours) {
        if (scene != vtk_->scene || !vtk_->view) return;
        if (!colours.error.isEmpty()) return Note(colours.error);
        vtk_->view->SetPointRgb(colours.value);
        Note("");
        Render();
      });
}

PlanFrame SceneDesk::PlanOf() const {
  PlanFrame frame;
  const SceneModel* model = vtk_->model();
  if (model == nullptr || model->Empty()) return frame;
  const double ratio = vtk_->widget->devicePixelRatioF(), metres = workspace_->metres_per_unit();
  for (const Eigen::AlignedBox2d& box : vtk_->view->LegendBoxes(vtk_->renderer)) {
    frame.legend.emplace_back(box.min().x() / ratio, (vtk_->window->GetSize()[1] - box.max().y()) / ratio,
                              box.sizes().x() / ratio, box.sizes().y() / ratio);
  }
  const Eigen::Vector3d origin = vtk_->PlaceUnder(0, 0), right = vtk_->PlaceUnder(ratio * 100, 0),
                        down = vtk_->PlaceUnder(0, ratio * 100);
  const double metres_per_px = (right - origin).head<2>().norm() / 100;
  if (!(metres_per_px > 0)) return frame;
  frame.unit = workspace_->unit();
  frame.bar_px = metres / metres_per_px;
  frame.name = model->on_earth ? tr("site, E and N in %1").arg(frame.unit) : tr("x and y in %1").arg(frame.unit);
  frame.has_north = model->on_earth;
  const auto plain = [&](const Eigen::Vector3d& p) { return Eigen::Vector2d(p.head<2>() / metres); };
  frame.origin = plain(origin);
  frame.a = (plain(right) - plain(origin)) / 100;
  frame.b = (plain(down) - plain(origin)) / 100;
  const Crs* crs = vtk_->scene->crs.get();
  if (crs == nullptr || crs->geographic()) return frame;
  try {
    const auto at = [&](const Eigen::Vector3d& p) { return crs->FromGeodetic(vtk_->scene->frame->GeodeticFromEnu(p)); };
    frame.origin = at(origin);
    frame.a = (at(right) - at(origin)) / 100;
    frame.b = (at(down) - at(origin)) / 100;
    frame.name = QString("EPSG:%1").arg(crs->epsg());
  } catch (const Error&) {  // it has no place here: the site's own grid stays
  }
  return frame;
}

void SceneDesk::ShowOverlays() {
  if (cube_ == nullptr || !vtk_->view) return;
  vtk_->view->MakeRoomForLabels(vtk_->renderer);
  vtk_->SizeRings(devicePixelRatioF());
  if (inside()) return;
  // In the plan scale and north stay at the window's edge; the scene's own are for pictures of it.
  const bool plan = mode() == "plan";
  vtk_->view->SetVisible("axes", IsChecked("axes") && (!plan || picturing_));
  if (plan) return overlay_->SetFrame(PlanOf());
  vtkCamera* camera = vtk_->renderer->GetActiveCamera();
  const Eigen::Vector3d back =
      (Eigen::Vector3d(camera->GetPosition()) - Eigen::Vector3d(camera->GetFocalPoint())).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d(camera->GetViewUp()).cross(back).normalized();
  Eigen::Matrix3d axes;
  axes << right, back.cross(right), back;
  if (axes.allFinite()) cube_->SetView(axes);
}

void SceneDesk::PlaceOverlays() {
  if (cube_ == nullptr) return;
  const bool plan = mode() == "plan", there = vtk_->view && !inside();
  cube_->setVisible(there && !plan);
  overlay_->setVisible(there && plan);
  cube_->move(vtk_->widget->width() - cube_->width() - kOverlayMargin_px, kOverlayMargin_px);
  overlay_->setGeometry(vtk_->widget->rect());
}

void SceneDesk::LookFrom(const Eigen::Vector3d& from) {
  if (!vtk_->view || inside() || mode() == "plan") return;
  vtkCamera* camera = vtk_->renderer->GetActiveCamera();
  const Eigen::Vector3d focus(camera->GetFocalPoint());
  const double away = (Eigen::Vector3d(camera->GetPosition()) - focus).norm();
  const Eigen::Vector3d back =
      (from - (std::abs(from.z()) > 0.9 ? kAlmostAbove : 0) * Eigen::Vector3d::UnitY()).normalized();
  const Eigen::Vector3d eye = focus + away * back;
  camera->SetPosition(eye.data());
  camera->SetViewUp(0, 0, 1);
  vtk_->renderer->ResetCameraClippingRange();
  Render();
}

void SceneDesk::ListInside() {
  const bool in = inside() && vtk_->model() != nullptr;
  const QSignalBlocker block(inside_run_);
  inside_run_->clear();
  if (in) {
    const auto& panoramas = vtk_->model()->panoramas;
    for (size_t i = 0; i < panoramas.size(); ++i) {
      if (panoramas[i].panorama != panoramas[vtk_->inside].panorama) continue;
      inside_run_->addItem(Text(panoramas[i].run), static_cast<int>(i));
      if (i == vtk_->inside) inside_run_->setCurrentIndex(inside_run_->count() - 1);
    }
  }
  inside_run_->setVisible(in && inside_run_->count() > 1);
  for (QToolButton* b : {previous_, next_}) b->setVisible(in);
  PlaceOverlays();
}

bool SceneDesk::IsChecked(const QString& layer) const {
  for (int i = 0; i < layers_->count(); ++i) {
    if (layers_->item(i)->data(Qt::UserRole).toString() == layer) return layers_->item(i)->checkState() == Qt::Checked;
  }
  return false;
}

}  // namespace trigpoint
