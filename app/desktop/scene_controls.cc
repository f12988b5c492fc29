// The scene desk's mouse and keyboard, and what stands under the mouse.
#include <fmt/format.h>
#include <vtkCamera.h>

#include <QApplication>
#include <QCheckBox>
#include <QClipboard>
#include <QComboBox>
#include <QKeyEvent>
#include <QLabel>
#include <QListWidget>
#include <QMouseEvent>
#include <QSlider>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>
#include <map>

#include "app/desktop/scene_desk.h"
#include "app/desktop/scene_styles.h"
#include "app/desktop/scene_vtk.h"
#include "calib/base/error.h"
#include "calib/geo/geodetic.h"
#include "datasets/export/crs.h"

namespace trigpoint {

namespace {

constexpr double kKeyTurn_deg = 5;
constexpr double kKeyZoom = 1.2;
constexpr double kNarrowest_deg = 5, kWidest_deg = 110;  // of the view from inside a panorama

// In the CRS where that has metres or feet; else empty.
QString CrsText(const Geodetic& place, const Crs* crs) {
  if (crs == nullptr || crs->geographic()) return "";
  try {
    const Eigen::Vector2d at = crs->FromGeodetic(place);
    return QString::fromStdString(fmt::format("EPSG:{} {:.3f} {:.3f}", crs->epsg(), at.x(), at.y()));
  } catch (const Error&) {  // it has no place there
    return "";
  }
}

}  // namespace

bool SceneDesk::eventFilter(QObject* watched, QEvent* event) {
  const double ratio = vtk_->widget->devicePixelRatioF();
  switch (event->type()) {
    case QEvent::MouseButtonPress:
      pressed_ = static_cast<QMouseEvent*>(event)->localPos();
      vtk_->pivot = vtk_->Aim(ratio * pressed_);
      break;
    case QEvent::MouseButtonRelease: {
      const auto* mouse = static_cast<QMouseEvent*>(event);
      if ((mouse->localPos() - pressed_).manhattanLength() >= 4) break;
      const QPointF at = ratio * mouse->localPos();
      if (mouse->button() == Qt::LeftButton) PickAt(at.x(), at.y());
      if (mouse->button() == Qt::RightButton && !measure_->isChecked()) {
        workspace_->AskMenu(ObjectAt(at), mouse->globalPos());
      }
      break;
    }
    case QEvent::MouseButtonDblClick: {
      const auto* mouse = static_cast<QMouseEvent*>(event);
      if (mouse->button() != Qt::LeftButton || measure_->isChecked()) break;
      const QString object = ObjectAt(ratio * mouse->localPos());
      if (!object.isEmpty()) emit Activated(object);
      break;
    }
    case QEvent::MouseMove: Hover(ratio * static_cast<QMouseEvent*>(event)->localPos()); break;
    case QEvent::Wheel: {
      const auto* wheel = static_cast<QWheelEvent*>(event);
      ZoomAt(ratio * wheel->position(), std::pow(1.0015, wheel->angleDelta().y()));
      return true;
    }
    case QEvent::Resize: PlaceOverlays(); break;
    case QEvent::KeyPress: return PressKey(static_cast<QKeyEvent*>(event));
    case QEvent::KeyRelease: return true;  // VTK has keys of its own: r shrinks, 3 turns everything magenta
    default: break;
  }
  return QWidget::eventFilter(watched, event);
}

bool SceneDesk::PressKey(QKeyEvent* event) {
  vtkCamera* camera = vtk_->renderer->GetActiveCamera();
  const QPointF middle(0.5 * vtk_->window->GetSize()[0], 0.5 * vtk_->window->GetSize()[1]);
  const Eigen::Vector3d eye(camera->GetPosition()), focus(camera->GetFocalPoint());
  const bool plan = mode() == "plan" && !inside();
  const auto turn = [&](double left, double up) {
    if (plan) {  // looks straight down: moves instead
      const double step = 0.1 * camera->GetParallelScale();
      vtk_->Move(Eigen::Vector3d((left > 0 ? -step : left < 0 ? step : 0), (up > 0 ? step : up < 0 ? -step : 0), 0));
    } else if (inside()) {
      TurnAbout(camera, eye, left, up);
    } else {
      TurnAbout(camera, focus, left, up);
    }
    vtk_->renderer->ResetCameraClippingRange();
    Render();
  };
  if ((event->modifiers() & Qt::ShiftModifier) != 0 && LookFromKey(event->key())) return true;
  switch (event->key()) {
    case Qt::Key_Tab:
    case Qt::Key_Backtab: return false;
    case Qt::Key_Left: turn(kKeyTurn_deg, 0); break;
    case Qt::Key_Right: turn(-kKeyTurn_deg, 0); break;
    case Qt::Key_Up: turn(0, kKeyTurn_deg); break;
    case Qt::Key_Down: turn(0, -kKeyTurn_deg); break;
    case Qt::Key_Plus:
    case Qt::Key_Equal: ZoomAt(middle, kKeyZoom); break;
    case Qt::Key_Minus: ZoomAt(middle, 1 / kKeyZoom); break;
    case Qt::Key_Home: ShowAll(); break;
    case Qt::Key_F: LookAt(workspace_->selected()); break;
    case Qt::Key_Escape:
      stepping_.reset();
      if (inside()) StepOutside();
      break;
    case Qt::Key_PageDown: StepBy(1); break;
    case Qt::Key_PageUp: StepBy(-1); break;
    case Qt::Key_C:
      if ((event->modifiers() & Qt::ControlModifier) != 0) QApplication::clipboard()->setText(place_->text());
      break;
    default: break;
  }
  return true;
}

bool SceneDesk::LookFromKey(int key) {
  const std::map<int, Eigen::Vector3d> sides = {{Qt::Key_T, {0, 0, 1}},
                                                {Qt::Key_N, {0, 1, 0}},
                                                {Qt::Key_S, {0, -1, 0}},
                                                {Qt::Key_E, {1, 0, 0}},
                                                {Qt::Key_W, {-1, 0, 0}}};
  const auto side = sides.find(key);
  if (side != sides.end()) LookFrom(side->second);
  return side != sides.end();
}

QString SceneDesk::mode() const { return mode_->currentData().toString(); }

void SceneDesk::ZoomAt(const QPointF& at, double factor) {
  if (!vtk_->view) return;
  vtkCamera* camera = vtk_->renderer->GetActiveCamera();
  if (inside()) {
    camera->SetViewAngle(std::clamp(camera->GetViewAngle() / factor, kNarrowest_deg, kWidest_deg));
  } else {
    const Eigen::Vector3d eye(camera->GetPosition()), focus(camera->GetFocalPoint());
    const Eigen::Vector3d place = vtk_->Aim(at);
    // What is under the mouse stays there.
    if (camera->GetParallelProjection()) {
      const Eigen::Vector3d ahead = (focus - eye).normalized();
      Eigen::Vector3d by = (1 - 1 / factor) * (place - focus);
      by -= by.dot(ahead) * ahead;
      vtk_->Move(by);
      camera->SetParallelScale(camera->GetParallelScale() / factor);
    } else {
      if ((place - eye).norm() < 0.1 && factor > 1) return;
      const Eigen::Vector3d new_eye = eye + (1 - 1 / factor) * (place - eye);
      const Eigen::Vector3d new_focus = new_eye + (focus - eye) / factor;
      camera->SetPosition(new_eye.data());
      camera->SetFocalPoint(new_focus.data());
    }
  }
  vtk_->renderer->ResetCameraClippingRange();
  Render();
}

void SceneDesk::ShowAll() {
  if (!vtk_->view || inside()) return;
  mode() == "plan" ? vtk_->view->LookDown(vtk_->renderer) : vtk_->view->LookOblique(vtk_->renderer);
  Render();
}

void SceneDesk::Hover(const QPointF& at) {
  const SceneModel* model = vtk_->model();
  if (model == nullptr || inside() || model->Empty()) return SayPlace("");
  const Eigen::Vector3d p = vtk_->PlaceUnder(at.x(), at.y());
  const double metres = workspace_->metres_per_unit();
  const auto length = [&](double value) { return QString::number(value / metres, 'f', 2); };
  QString text = (model->on_earth ? tr("E %1  N %2  U %3 %4") : tr("x %1  y %2  z %3 %4"))
                     .arg(length(p.x()), length(p.y()), length(p.z()), workspace_->unit());
  if (vtk_->scene->frame) {
    const Geodetic place = vtk_->scene->frame->GeodeticFromEnu(p);
    text += QString("   WGS 84 %1, %2").arg(place.latitude_deg, 0, 'f', 7).arg(place.longitude_deg, 0, 'f', 7);
    const QString in_crs = CrsText(place, vtk_->scene->crs.get());
    if (!in_crs.isEmpty()) text += "   " + in_crs;
  }
  SayPlace(text);
}

void SceneDesk::SayPlace(const QString& text) {
  place_->setText(text);
  // Below the view of two side by side it keeps its room, in the status bar it leaves it to others.
  if (kind_ == Kind::kFull) place_->setVisible(!text.isEmpty());
}

void SceneDesk::FollowSlider() {
  const SceneModel* model = vtk_->model();
  if (model == nullptr) return;
  // An image itself; of a station, tag or panorama the camera nearest to it.
  const SceneCamera* wanted = nullptr;
  double nearest = HUGE_VAL;
  const QString of = run_->findText(workspace_->run()) >= 0 ? workspace_->run() : run_->currentText();
  for (const std::string& object : workspace_->related()) {
    const std::vector<ScenePick> found = vtk_->Find(object);
    for (const SceneCamera& camera : model->cameras) {
      if (object == "image:" + camera.run + "/" + camera.image) wanted = &camera, nearest = 0;
      if (found.empty() || object.starts_with("point:") || QString::fromStdString(camera.run) != of) continue;
      const double away = (camera.world_from_cam.translation - found.front().position).norm();
      if (away < nearest) wanted = &camera, nearest = away;
    }
  }
  if (wanted == nullptr) return;
  const QSignalBlocker block(time_);  // it is moved by the selection, and selects nothing
  const QString run = QString::fromStdString(wanted->run);
  if (run_->currentText() != run) run_->setCurrentIndex(run_->findText(run));
  for (size_t i = 0; i < vtk_->cameras.size(); ++i) {
    if (&model->cameras[static_cast<size_t>(vtk_->cameras[i])] == wanted) time_->setValue(static_cast<int>(i));
  }
  camera_->setText(QString::fromStdString(wanted->image));
}

void SceneDesk::StepBy(int by) {
  const SceneModel* model = vtk_->model();
  if (model == nullptr || !inside()) return;
  const ScenePanorama& here = model->panoramas[vtk_->inside];
  const size_t from = stepping_.value_or(vtk_->inside);  // as fast as the keys are pressed
  std::vector<size_t> others;
  for (size_t i = 0; i < model->panoramas.size(); ++i) {
    const ScenePanorama& p = model->panoramas[i];
    if (p.run == here.run && p.kind == ReferenceKind::kPanorama && !p.file.empty()) others.push_back(i);
  }
  const auto at = std::find(others.begin(), others.end(), from);
  if (at == others.end() || others.size() < 2) return;
  const auto count = static_cast<std::ptrdiff_t>(others.size());
  const std::ptrdiff_t next = ((at - others.begin()) + by + count) % count;
  StepInto(others[static_cast<size_t>(next)]);
}

void SceneDesk::ShowOpacity() {
  const QListWidgetItem* item = layers_->currentItem();
  opacity_->setEnabled(item != nullptr);
  if (item == nullptr) return;
  const QSignalBlocker block(opacity_);
  const auto set = opacities_.find(item->data(Qt::UserRole).toString().toStdString());
  opacity_->setValue(set == opacities_.end() ? 100 : set->second);
}

void SceneDesk::SetOpacity(int percent) {
  const QListWidgetItem* item = layers_->currentItem();
  if (item == nullptr) return;
  opacities_[item->data(Qt::UserRole).toString().toStdString()] = percent;
  DrawAsSet();
  Render();
}

}  // namespace trigpoint
