#include "app/desktop/picture_view.h"

#include <QContextMenuEvent>
#include <QHelpEvent>
#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QToolTip>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>

namespace trigpoint {

namespace {

constexpr double kMostScale = 64;    // screen pixels a picture pixel
constexpr double kGridScale = 16;    // from here on pixels are seen as squares
constexpr double kPickDistance = 8;  // screen pixels
// A part that is looked at: screen pixels a picture pixel at most, and its longer side on the screen, in shares of the
// view's shorter side and in pixels where those leave a choice. 0.8: a tag with the white border that it needs.
constexpr double kMostPartScale = 6;
constexpr double kLeastPartShare = 0.4, kMostPartShare = 0.8;
constexpr double kPartSide_px = 240;

}  // namespace

PictureView::PictureView(QWidget* parent) : QWidget(parent) {
  setMouseTracking(true);
  setFocusPolicy(Qt::StrongFocus);
  setMinimumSize(160, 120);
  setToolTip(tr("Wheel or + and -: zoom; drag or arrows: move; 0: fit; 1: pixel by pixel"));
}

void PictureView::SetPicture(const QImage& image, const QString& title) {
  const bool same_size = image.size() == image_.size() && !image.isNull();
  image_ = image;
  title_ = title;
  setAccessibleDescription(title);
  if (!same_size || fitted_) Fit();
  update();
}

void PictureView::SetMarks(std::vector<PictureMark> marks) {
  marks_ = std::move(marks);
  moved_ = -1;
  update();
}

void PictureView::SetHighlight(const QString& object) {
  highlight_ = object;
  update();
}

double PictureView::FittedScale() const {
  if (image_.isNull()) return 1;
  return std::min(static_cast<double>(width()) / image_.width(), static_cast<double>(height()) / image_.height());
}

void PictureView::Release() {
  fitted_ = false;
  part_.reset();
}

void PictureView::Fit() {
  Release();
  fitted_ = true;
  if (image_.isNull() || width() == 0 || height() == 0) return;
  scale_ = FittedScale();
  offset_ = QPointF(0.5 * (width() - scale_ * image_.width()), 0.5 * (height() - scale_ * image_.height()));
  update();
  emit ViewChanged();
}

void PictureView::LookAt(const QPointF& pixel, double scale) {
  Release();
  scale_ = std::clamp(scale, 0.02, kMostScale);
  offset_ = QPointF(0.5 * width(), 0.5 * height()) - scale_ * (pixel + QPointF(0.5, 0.5));
  update();
  emit ViewChanged();
}

void PictureView::LookAt(const QRectF& part) {
  const double longer = std::max({1.0, part.width(), part.height()});
  const double room = std::min(width(), height());
  const double side = std::clamp(kPartSide_px, kLeastPartShare * room, kMostPartShare * room);
  LookAt(part.center(), std::min(kMostPartScale, side / longer));
  part_ = part;
}

QPointF PictureView::PixelAt(const QPointF& widget) const { return (widget - offset_) / scale_ - QPointF(0.5, 0.5); }
QPointF PictureView::WidgetAt(const QPointF& pixel) const { return offset_ + scale_ * (pixel + QPointF(0.5, 0.5)); }

void PictureView::Zoom(double factor, const QPointF& about) {
  const QPointF pixel = PixelAt(about);
  Release();
  scale_ = std::clamp(scale_ * factor, 0.02, kMostScale);
  offset_ += about - WidgetAt(pixel);
  update();
  emit ViewChanged();
}

// Of what lies under the mouse its name.
bool PictureView::event(QEvent* event) {
  if (event->type() != QEvent::ToolTip) return QWidget::event(event);
  const auto* help = static_cast<QHelpEvent*>(event);
  const QString object = ObjectAt(PixelAt(help->pos()));
  QToolTip::showText(help->globalPos(),
                     object.isEmpty() ? toolTip() : object.section(':', 0, 0) + " " + object.section(':', 1), this);
  return true;
}

void PictureView::PaintMark(QPainter* painter, const PictureMark& mark, bool strong) const {
  QPolygonF at;
  for (const QPointF& point : mark.points) at << WidgetAt(point);
  if (at.isEmpty()) return;
  switch (mark.kind) {
    case PictureMark::Kind::kCross: {
      const double r = strong ? 12 : 4;
      painter->drawLine(at[0] - QPointF(r, 0), at[0] + QPointF(r, 0));
      painter->drawLine(at[0] - QPointF(0, r), at[0] + QPointF(0, r));
      break;
    }
    case PictureMark::Kind::kLine: painter->drawPolyline(at); break;
    case PictureMark::Kind::kOutline: painter->drawPolygon(at); break;
    case PictureMark::Kind::kCircle: {
      const double r = std::max(4.0, scale_ * mark.points[1].x());
      painter->drawEllipse(at[0], r, r);
      break;
    }
  }
}

void PictureView::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.fillRect(rect(), palette().color(QPalette::Dark));
  if (image_.isNull()) {
    painter.setPen(palette().color(QPalette::BrightText));
    painter.drawText(rect(), Qt::AlignCenter | Qt::TextWordWrap, title_.isEmpty() ? tr("no picture") : title_);
    return;
  }
  painter.setRenderHint(QPainter::SmoothPixmapTransform, scale_ < 2);
  // Only the part that is seen: a panorama at full zoom stays quick.
  const QRectF seen = QRectF(-offset_ / scale_, QSizeF(size()) / scale_).intersected(QRectF(image_.rect()));
  painter.drawImage(QRectF(offset_ + scale_ * seen.topLeft(), scale_ * seen.size()), image_, seen);
  if (scale_ >= kGridScale) {
    painter.setPen(QPen(QColor(128, 128, 128, 90), 1));
    for (int x = static_cast<int>(seen.left()); x <= seen.right(); ++x) {
      const double at = offset_.x() + scale_ * x;
      painter.drawLine(QPointF(at, 0), QPointF(at, height()));
    }
    for (int y = static_cast<int>(seen.top()); y <= seen.bottom(); ++y) {
      const double at = offset_.y() + scale_ * y;
      painter.drawLine(QPointF(0, at), QPointF(width(), at));
    }
  }
  painter.setRenderHint(QPainter::Antialiasing);
  for (const PictureMark& mark : marks_) {
    const bool strong = mark.strong || (!mark.object.isEmpty() && mark.object == highlight_);
    if (mark.colour.alpha() == 0 && !strong) continue;  // it can be clicked, the picture shows it
    painter.setBrush(Qt::NoBrush);
    if (strong) {  // a colour that no series has: black, seen on anything by its white edge
      painter.setPen(QPen(Qt::white, 7));
      PaintMark(&painter, mark, true);
    }
    painter.setPen(strong ? QPen(Qt::black, 3) : QPen(mark.colour, 1.5));
    PaintMark(&painter, mark, strong);
  }
  PaintNames(&painter);
  if (!title_.isEmpty()) {
    const QFontMetrics font = painter.fontMetrics();
    const QString title = font.elidedText(title_, Qt::ElideLeft, width() - 8);
    painter.fillRect(QRectF(0, 0, font.horizontalAdvance(title) + 8.0, font.height() + 4.0),
                     QColor(255, 255, 255, 200));
    painter.setPen(Qt::black);
    painter.drawText(QPointF(4, font.ascent() + 2), title);
  }
  if (hasFocus()) {
    painter.setPen(QPen(palette().color(QPalette::Highlight), 2));
    painter.drawRect(rect().adjusted(1, 1, -1, -1));
  }
}

// Each name stands beside its mark and overlaps no other. A name without room is left out; zooming in makes room.
void PictureView::PaintNames(QPainter* painter) {
  std::vector<QRectF> taken;
  for (const PictureMark& mark : marks_) {
    if (mark.text.isEmpty() || mark.points.isEmpty()) continue;
    if (mark.colour.alpha() == 0 && (mark.object.isEmpty() || mark.object != highlight_)) continue;
    const QPointF at = WidgetAt(mark.points[0]);
    const QRectF text = painter->fontMetrics().boundingRect(mark.text);
    const double left = -6 - text.right(), above = -6, below = 6 - text.top();
    for (const QPointF& beside : {QPointF(6, above), QPointF(6, below), QPointF(left, above), QPointF(left, below),
                                  QPointF(6, above - text.height()), QPointF(6, below + text.height())}) {
      const QRectF box = text.translated(at + beside).adjusted(-2, -1, 2, 1);
      if (std::any_of(taken.begin(), taken.end(), [&](const QRectF& other) { return other.intersects(box); })) continue;
      taken.push_back(box);
      painter->fillRect(box, QColor(255, 255, 255, 200));
      painter->setPen(Qt::black);
      painter->drawText(at + beside, mark.text);
      break;
    }
  }
}

void PictureView::wheelEvent(QWheelEvent* event) {
  Zoom(std::pow(1.0015, event->angleDelta().y()), event->position());
  event->accept();
}

void PictureView::mousePressEvent(QMouseEvent* event) {
  setFocus();
  pressed_ = event->localPos();
  dragged_ = false;
  moved_ = event->button() == Qt::LeftButton ? MovableAt(PixelAt(pressed_)) : -1;
}

void PictureView::mouseMoveEvent(QMouseEvent* event) {
  if ((event->buttons() & Qt::LeftButton) != 0) {
    const QPointF by = event->localPos() - pressed_;
    if (!dragged_ && by.manhattanLength() < 4) return;
    dragged_ = true;
    pressed_ = event->localPos();
    if (moved_ >= 0) {
      marks_[static_cast<size_t>(moved_)].points[0] += by / scale_;
    } else {
      Release();
      offset_ += by;
      emit ViewChanged();
    }
    update();
  }
  emit Hovered(PixelAt(event->localPos()));
}

void PictureView::mouseReleaseEvent(QMouseEvent* event) {
  if (dragged_ && moved_ >= 0 && moved_ < static_cast<int>(marks_.size())) {
    const PictureMark& mark = marks_[static_cast<size_t>(moved_)];
    emit MarkMoved(mark.object, mark.points[0]);
  }
  moved_ = -1;
  if (dragged_ || event->button() != Qt::LeftButton || image_.isNull()) return;
  const QPointF pixel = PixelAt(event->localPos());
  emit Clicked(pixel, ObjectAt(pixel));
}

void PictureView::mouseDoubleClickEvent(QMouseEvent* event) {
  mousePressEvent(event);
  emit DoubleClicked(ObjectAt(PixelAt(event->localPos())));
}

void PictureView::contextMenuEvent(QContextMenuEvent* event) {
  const QString object = ObjectAt(PixelAt(event->pos()));
  if (!object.isEmpty()) emit MenuAsked(object, event->globalPos());
}

void PictureView::keyPressEvent(QKeyEvent* event) {
  const QPointF middle(0.5 * width(), 0.5 * height());
  const double step = 0.1 * std::min(width(), height());
  switch (event->key()) {
    case Qt::Key_Plus:
    case Qt::Key_Equal: Zoom(1.25, middle); return;
    case Qt::Key_Minus: Zoom(0.8, middle); return;
    case Qt::Key_0: Fit(); return;
    case Qt::Key_1: LookAt(PixelAt(middle), 1); return;
    case Qt::Key_Left: offset_ += QPointF(step, 0); break;
    case Qt::Key_Right: offset_ -= QPointF(step, 0); break;
    case Qt::Key_Up: offset_ += QPointF(0, step); break;
    case Qt::Key_Down: offset_ -= QPointF(0, step); break;
    case Qt::Key_Return:
    case Qt::Key_Enter: emit Clicked(PixelAt(middle), ObjectAt(PixelAt(middle))); return;
    default: QWidget::keyPressEvent(event); return;
  }
  Release();
  update();
  emit ViewChanged();
}

void PictureView::resizeEvent(QResizeEvent*) {
  if (fitted_) Fit();
  if (part_) LookAt(QRectF(*part_));
  emit ViewChanged();
}

int PictureView::MovableAt(const QPointF& pixel) const {
  for (size_t i = 0; i < marks_.size(); ++i) {
    if (!marks_[i].movable) continue;
    const QPointF by = marks_[i].points[0] - pixel;
    if (std::hypot(by.x(), by.y()) < kPickDistance / scale_) return static_cast<int>(i);
  }
  return -1;
}

QString PictureView::ObjectAt(const QPointF& pixel) const {
  QString nearest;
  double least = kPickDistance / scale_;
  for (const PictureMark& mark : marks_) {
    if (mark.object.isEmpty() || mark.points.isEmpty()) continue;
    if (mark.kind == PictureMark::Kind::kOutline && mark.points.containsPoint(pixel, Qt::OddEvenFill)) {
      return mark.object;
    }
    const QPointF by = mark.points[0] - pixel;
    const double distance = std::hypot(by.x(), by.y());
    if (distance < least) least = distance, nearest = mark.object;
  }
  return nearest;
}

}  // namespace trigpoint
