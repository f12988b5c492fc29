#include "app/desktop/services_map.h"

#include <QHelpEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QPainterPath>
#include <QToolTip>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>

#include "eval/report/plan.h"

namespace trigpoint {

namespace {

constexpr double kMargin = 24, kDot = 6, kReach = 12;  // px
// Okabe and Ito's, told apart by everybody; older years begin again.
const char* const kColours[] = {"#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#b8a800", "#666666"};

// A mark for each source: circle, square, triangle, diamond.
QPainterPath MarkOf(int service, const QPointF& at, double radius) {
  QPainterPath path;
  if (service == 0) path.addEllipse(at, radius, radius);
  if (service == 1) path.addRect(at.x() - 0.85 * radius, at.y() - 0.85 * radius, 1.7 * radius, 1.7 * radius);
  if (service < 2) return path;
  QPolygonF corners;
  const int count = service == 2 ? 3 : 4;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * EIGEN_PI * k / count;
    corners << at + 1.2 * radius * QPointF(std::sin(angle), -std::cos(angle));
  }
  path.addPolygon(corners);
  path.closeSubpath();
  return path;
}

}  // namespace

ServicesMap::ServicesMap(QWidget* parent) : QWidget(parent) {
  setObjectName("services.map");
  setAccessibleName(tr("Map of the run and of the panoramas that services have"));
  setMinimumSize(360, 260);
  setMouseTracking(true);
}

QPointF ServicesMap::East(const Geodetic& position) const {
  const Eigen::Vector3d enu = LocalFrame(origin_).EnuFromGeodetic({position.latitude_deg, position.longitude_deg, 0});
  return {enu.x(), enu.y()};
}

void ServicesMap::Show(const std::vector<Geodetic>& track, const std::vector<FoundPanorama>& found) {
  track_.clear(), places_.clear(), services_.clear(), years_.clear();
  zoom_ = 1;
  shift_ = {};
  origin_ = !track.empty() ? track.front() : found.empty() ? Geodetic{} : found.front().record.position;
  origin_.height_m = 0;
  for (const Geodetic& point : track) track_.push_back(East(point));
  for (const FoundPanorama& f : found) {
    places_.push_back(East(f.record.position));
    ++years_[f.Year()];
    if (std::find(services_.begin(), services_.end(), f.service) == services_.end()) services_.push_back(f.service);
  }
  QPolygonF all;
  for (const auto* points : {&track_, &places_}) {
    for (const QPointF& p : *points) all << p;
  }
  constexpr double kLeast_m = 10;  // of an extent, so that a single place has one
  extent_ = all.boundingRect();
  const double x = std::max(0.0, kLeast_m - extent_.width()) / 2, y = std::max(0.0, kLeast_m - extent_.height()) / 2;
  extent_.adjust(-x, -y, x, y);
  Mark(found);
}

void ServicesMap::Mark(const std::vector<FoundPanorama>& found) {
  found_ = found;
  update();
}

double ServicesMap::Scale() const {
  const double across = (width() - 2 * kMargin) / std::max(1e-3, extent_.width());
  const double down = (height() - 2 * kMargin) / std::max(1e-3, extent_.height());
  return zoom_ * std::min(across, down);
}

QPointF ServicesMap::OnScreen(const QPointF& east_north) const {
  const QPointF d = Scale() * (east_north - extent_.center());
  return QPointF(width() / 2.0 + d.x(), height() / 2.0 - d.y()) + shift_;
}

QPoint ServicesMap::PlaceOf(int index) const { return OnScreen(places_.at(static_cast<size_t>(index))).toPoint(); }

int ServicesMap::At(const QPoint& place) const {
  int best = -1;
  double nearest = kReach;
  for (size_t i = 0; i < places_.size(); ++i) {
    const QPointF d = OnScreen(places_[i]) - place;
    if (const double away = std::hypot(d.x(), d.y()); away < nearest) nearest = away, best = static_cast<int>(i);
  }
  return best;
}

QColor ServicesMap::ColourOf(const std::string& year) const {
  const auto newer = std::distance(years_.find(year), years_.end()) - 1;
  return kColours[static_cast<size_t>(newer) % std::size(kColours)];
}

void ServicesMap::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.fillRect(rect(), palette().base());
  const QColor ink = palette().text().color();
  QPolygonF line;
  for (const QPointF& p : track_) line << OnScreen(p);
  painter.setPen(QPen(ink, 2));
  painter.drawPolyline(line);
  for (size_t i = 0; i < found_.size(); ++i) {
    const auto service = std::find(services_.begin(), services_.end(), found_[i].service) - services_.begin();
    const bool picked = found_[i].picked;
    const QPainterPath mark = MarkOf(static_cast<int>(service), OnScreen(places_[i]), picked ? kDot + 2 : kDot);
    painter.setPen(QPen(picked ? ink : palette().base().color(), picked ? 2.5 : 1));
    painter.setBrush(ColourOf(found_[i].Year()));
    painter.drawPath(mark);
  }
  DrawLegend(&painter);
}

void ServicesMap::SetUnit(const DisplayUnit& unit) {
  unit_ = unit;
  update();
}

double ServicesMap::ScaleLength() const { return RoundDown(0.25 * width() / (Scale() * unit_.metres)); }

QString ServicesMap::ScaleText() const {
  return QString("%1 %2").arg(ScaleLength()).arg(QString::fromStdString(unit_.name));
}

void ServicesMap::DrawLegend(QPainter* painter) const {
  const QColor ink = palette().text().color();
  const int row = fontMetrics().height() + 4;
  int y = 8;
  const auto entry = [&](int service, const QColor& colour, const QString& text) {
    painter->setPen(Qt::NoPen);
    painter->setBrush(colour);
    painter->drawPath(MarkOf(service, QPointF(16, y + row / 2.0), kDot));
    painter->setPen(ink);
    painter->drawText(QRect(30, y, width(), row), Qt::AlignVCenter, text);
    y += row;
  };
  if (services_.size() > 1) {
    for (size_t s = 0; s < services_.size(); ++s) entry(static_cast<int>(s), ink, QString::fromStdString(services_[s]));
  }
  for (const auto& [year, count] : years_) {
    entry(0, ColourOf(year), QString("%1: %2").arg(QString::fromStdString(year)).arg(count));
  }
  if (track_.empty() && found_.empty()) return;
  const double px = ScaleLength() * unit_.metres * Scale();
  const QPointF end(width() - 12, height() - 12);
  painter->setPen(QPen(ink, 2));
  painter->drawLine(end - QPointF(px, 0), end);
  painter->drawText(QRectF(end.x() - px - 100, end.y() - row - 2, px + 100, row), Qt::AlignRight, ScaleText());
  painter->drawText(QRectF(width() - 60, 8, 48, row), Qt::AlignRight, tr("N up"));
}

void ServicesMap::mousePressEvent(QMouseEvent* event) {
  pressed_ = event->pos();
  dragged_ = false;
}

void ServicesMap::mouseMoveEvent(QMouseEvent* event) {
  if ((event->buttons() & Qt::LeftButton) == 0) return;
  const QPointF moved = event->pos() - pressed_;
  if (!dragged_ && moved.manhattanLength() < 5) return;
  dragged_ = true;
  shift_ += moved;
  pressed_ = event->pos();
  update();
}

void ServicesMap::mouseReleaseEvent(QMouseEvent* event) {
  const int index = dragged_ ? -1 : At(event->pos());
  if (index >= 0) emit Clicked(index);
}

void ServicesMap::wheelEvent(QWheelEvent* event) {
  const double factor = std::pow(1.2, event->angleDelta().y() / 120.0);
  const double zoom = std::clamp(zoom_ * factor, 1.0, 200.0);
  // What is under the pointer stays there.
  const QPointF from_middle = event->position() - QPointF(width() / 2.0, height() / 2.0);
  shift_ = from_middle - (zoom / zoom_) * (from_middle - shift_);
  zoom_ = zoom;
  update();
}

bool ServicesMap::event(QEvent* event) {
  if (event->type() != QEvent::ToolTip) return QWidget::event(event);
  const auto* help = static_cast<QHelpEvent*>(event);
  const int index = At(help->pos());
  if (index < 0) {
    QToolTip::hideText();
    return true;
  }
  const PanoramaRecord& r = found_[static_cast<size_t>(index)].record;
  QToolTip::showText(help->globalPos(),
                     QString::fromStdString(r.id + "\n" + r.date.substr(0, 10) + "\n" + r.attribution));
  return true;
}

}  // namespace trigpoint
