#include "app/desktop/scene_overlay.h"

#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <cmath>

#include "eval/report/plan.h"

namespace trigpoint {

namespace {

constexpr int kCube_px = 84;
constexpr double kHalfSide = 0.27;  // of the widget's width
constexpr double kGridStep_px = 110, kBar_px = 140;
constexpr double kBarLeft_px = 12, kBarUp_px = 34;  // of the scale bar, from the left and from below

const std::array<Eigen::Vector3d, 6> kFaces = {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-1, 0, 0),
                                               Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, -1, 0),
                                               Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0, -1)};

// Dark on a light seam, so that it is read on any ground.
void PaintText(QPainter* painter, const QPointF& at, const QString& text) {
  QPainterPath path;
  path.addText(at, painter->font(), text);
  painter->strokePath(path, QPen(QColor(255, 255, 255, 220), 3));
  painter->fillPath(path, QColor(20, 20, 20));
}

}  // namespace

ViewCube::ViewCube(QWidget* parent) : QWidget(parent) {
  setObjectName("scene.cube");
  setAccessibleName(tr("Direction of view"));
  setFixedSize(kCube_px, kCube_px);
  setMouseTracking(true);
  setCursor(Qt::PointingHandCursor);
  setToolTip(tr("Look from this side (Shift with T, N, E, S, W)"));
}

void ViewCube::SetView(const Eigen::Matrix3d& scene_from_viewer) {
  if ((scene_from_viewer - scene_from_viewer_).cwiseAbs().maxCoeff() < 1e-6) return;
  scene_from_viewer_ = scene_from_viewer;
  update();
}

void ViewCube::SetOnEarth(bool on_earth) {
  on_earth_ = on_earth;
  update();
}

QPointF ViewCube::At(const Eigen::Vector3d& corner) const {
  const Eigen::Vector3d seen = scene_from_viewer_.transpose() * corner;
  const double side = kHalfSide * width();
  return {0.5 * width() + side * seen.x(), 0.5 * height() - side * seen.y()};
}

QPolygonF ViewCube::Outline(const Eigen::Vector3d& face) const {
  const Eigen::Vector3d u(face.y(), face.z(), face.x()), v = face.cross(u);
  return QPolygonF({At(face + u + v), At(face - u + v), At(face - u - v), At(face + u - v)});
}

QPointF ViewCube::MiddleOf(const Eigen::Vector3d& face) const {
  return face.dot(scene_from_viewer_.col(2)) > 0.05 ? At(face) : QPointF(-1, -1);
}

int ViewCube::FaceAt(const QPointF& at) const {
  for (size_t i = 0; i < kFaces.size(); ++i) {
    if (MiddleOf(kFaces[i]).x() >= 0 && Outline(kFaces[i]).containsPoint(at, Qt::OddEvenFill))
      return static_cast<int>(i);
  }
  return -1;
}

QString ViewCube::NameOf(int face) const {
  const QStringList earth{tr("E"), tr("W"), tr("N"), tr("S"), tr("top"), tr("below")};
  const QStringList plain{"+x", "-x", "+y", "-y", tr("top"), tr("below")};
  return on_earth_ ? earth[face] : plain[face];
}

void ViewCube::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  QFont font = painter.font();
  font.setBold(true);
  font.setPointSizeF(0.85 * font.pointSizeF());
  painter.setFont(font);
  const QColor ink = palette().color(QPalette::WindowText);
  for (int i = 0; i < static_cast<int>(kFaces.size()); ++i) {
    const Eigen::Vector3d& face = kFaces[static_cast<size_t>(i)];
    if (MiddleOf(face).x() < 0) continue;
    painter.setPen(QPen(ink, 1.2));
    QColor fill = palette().color(i == hovered_ ? QPalette::Highlight : QPalette::Base);
    fill.setAlpha(225);
    painter.setBrush(fill);
    painter.drawPolygon(Outline(face));
    if (face.dot(scene_from_viewer_.col(2)) < 0.3) continue;  // too narrow for its name
    painter.setPen(palette().color(i == hovered_ ? QPalette::HighlightedText : QPalette::Text));
    const QPointF at = At(face);
    painter.drawText(QRectF(at.x() - 30, at.y() - 10, 60, 20), Qt::AlignCenter, NameOf(i));
  }
}

void ViewCube::mousePressEvent(QMouseEvent* event) {
  const int face = FaceAt(event->localPos());
  if (face >= 0) emit Chosen(kFaces[static_cast<size_t>(face)]);
  event->accept();
}

void ViewCube::mouseMoveEvent(QMouseEvent* event) {
  hovered_ = FaceAt(event->localPos());
  update();
}

void ViewCube::leaveEvent(QEvent*) {
  hovered_ = -1;
  update();
}

PlanOverlay::PlanOverlay(QWidget* parent) : QWidget(parent) {
  setObjectName("scene.plan_overlay");
  setAttribute(Qt::WA_TransparentForMouseEvents);
  hide();
}

void PlanOverlay::SetFrame(const PlanFrame& frame) {
  if (frame == frame_) return;
  frame_ = frame;
  update();
}

void PlanOverlay::paintEvent(QPaintEvent*) {
  if (!(frame_.bar_px > 0)) return;
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  PaintGrid(&painter);
  PaintBar(&painter);
}

double PlanOverlay::BarLength() const { return RoundDown(kBar_px / frame_.bar_px); }

QString PlanOverlay::BarText() const { return QString("%1 %2; %3").arg(BarLength()).arg(frame_.unit, frame_.name); }

QRectF PlanOverlay::BarBox() const {
  const QFontMetrics metrics(font());
  const double wide = std::max<double>(metrics.horizontalAdvance(BarText()), BarLength() * frame_.bar_px);
  return QRectF(kBarLeft_px, height() - kBarUp_px - 5 - metrics.ascent(), wide, metrics.ascent() + 11);
}

void PlanOverlay::PaintGrid(QPainter* painter) const {
  Eigen::Matrix2d grid_from_pixel;
  grid_from_pixel << frame_.a, frame_.b;
  const Eigen::Matrix2d pixel_from_grid = grid_from_pixel.inverse();
  const double px_per_unit = pixel_from_grid.col(0).norm();
  const double step = RoundDown(2 * kGridStep_px / px_per_unit);
  Eigen::Vector2d low(1e300, 1e300), high(-1e300, -1e300);
  for (const QPointF& corner : {QPointF(0, 0), QPointF(width(), 0), QPointF(0, height()), QPointF(width(), height())}) {
    const Eigen::Vector2d at = frame_.origin + corner.x() * frame_.a + corner.y() * frame_.b;
    low = low.cwiseMin(at), high = high.cwiseMax(at);
  }
  std::vector<QRectF> taken = frame_.legend;
  taken.push_back(BarBox());
  const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  for (int axis = 0; axis < 2; ++axis) {
    for (double value = step * std::ceil(low[axis] / step); value <= high[axis]; value += step) {
      Eigen::Vector2d from = low, to = high;
      from[axis] = to[axis] = value;
      const Eigen::Vector2d p = pixel_from_grid * (from - frame_.origin), q = pixel_from_grid * (to - frame_.origin);
      painter->setPen(QPen(QColor(255, 255, 255, 110), 2));
      painter->drawLine(QPointF(p.x(), p.y()), QPointF(q.x(), q.y()));
      painter->setPen(QPen(QColor(40, 40, 40, 150), 0.7));
      painter->drawLine(QPointF(p.x(), p.y()), QPointF(q.x(), q.y()));
      const QString text = QString::number(value, 'f', decimals);
      QPointF at = axis == 0 ? QPointF(p.x() + 3, height() - 5) : QPointF(3, p.y() - 3);
      for (const QRectF& line : taken) {
        const bool over =
            axis == 1 && line.intersects(painter->fontMetrics().boundingRect(text).translated(at.toPoint()));
        if (over) at.setX(line.right() + 6);
      }
      PaintText(painter, at, text);
    }
  }
}

void PlanOverlay::PaintBar(QPainter* painter) const {
  const double px = BarLength() * frame_.bar_px;
  const double x = kBarLeft_px, y = height() - kBarUp_px;
  for (int part = 0; part < 4; ++part) {
    painter->fillRect(QRectF(x + part * px / 4, y, px / 4, 6), part % 2 == 0 ? QColor(20, 20, 20) : QColor(Qt::white));
  }
  painter->setPen(QColor(20, 20, 20));
  painter->setBrush(Qt::NoBrush);
  painter->drawRect(QRectF(x, y, px, 6));
  PaintText(painter, QPointF(x, y - 5), BarText());
  if (!frame_.has_north) return;
  painter->save();
  painter->translate(width() - 26, 44);
  painter->rotate(frame_.north_deg);
  painter->setPen(QPen(QColor(20, 20, 20), 1.2));
  painter->setBrush(QColor(20, 20, 20));
  painter->drawPolygon(QPolygonF({QPointF(0, -26), QPointF(-8, 12), QPointF(0, 5)}));
  painter->setBrush(Qt::white);
  painter->drawPolygon(QPolygonF({QPointF(0, -26), QPointF(8, 12), QPointF(0, 5)}));
  painter->restore();
  PaintText(painter, QPointF(width() - 30, 74), "N");
}

}  // namespace trigpoint
