#include "app/desktop/stage_graph.h"

#include <QHelpEvent>
#include <QKeyEvent>
#include <QPainter>
#include <QToolTip>
#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "app/desktop/run_desk.h"
#include "app/desktop/site_tree.h"
#include "app/pipeline/stages.h"

namespace trigpoint {
namespace {

constexpr double kGap = 8, kBetweenRows = 14, kPadding = 5;
constexpr int kLeastBeside = 2, kMostBeside = 3;  // boxes, in a narrow and in a wide window
constexpr double kSmall = 0.85;                   // font of all but the stage
constexpr const char *kNarrowText = "reconstruct", *kWideText = "reconstruct, 00:00:00";  // widths of a box

// The worst comes first.
int RankOf(const std::string& state) {
  static constexpr std::array kOrder = {"failed", "running", "out of date", "missing", "done"};
  const auto it = std::find(kOrder.begin(), kOrder.end(), state);
  if (it == kOrder.end()) return RankOf("missing");  // a result that was not looked at yet
  return static_cast<int>(it - kOrder.begin());
}

// "detections 12" and another result's "detections 30": 42; "median 0.3 m" and "median 0.5 m": the larger.
void AddMetric(const StageMetric& metric, StageBox* box) {
  if (box->metric.kind == StageMetric::Kind::kNone) {
    box->metric = metric;
  } else if (metric.kind == StageMetric::Kind::kCount) {
    box->metric.value += metric.value;
  } else if (metric.value > box->metric.value) {
    box->metric = metric;
  }
}

std::vector<StageBox> BoxesWithoutNeeds(const std::vector<SnapshotResult>& results) {
  std::vector<StageBox> boxes;
  for (const StageInfo& stage : Stages()) {
    StageBox box;
    box.stage = stage.name;
    std::string variant;  // the first of its results: other variants' metrics are for comparing
    for (const SnapshotResult& result : results) {
      if (result.stage != stage.name || result.state == "not needed") continue;
      if (box.results == 0 || RankOf(result.state) < RankOf(box.state)) box.state = result.state;
      if (box.results == 0) variant = result.variant;
      if (result.variant == variant) AddMetric(result.metric, &box);
      ++box.results;
      box.done += result.state == "done" ? 1 : 0;
      box.seconds += result.seconds;
    }
    if (box.results > 0) boxes.push_back(box);
  }
  return boxes;
}

// Layers with more boxes than stand beside each other have several rows.
void PlaceInRows(int most_beside, std::vector<StageBox>* boxes) {
  std::map<int, std::vector<StageBox*>> layers;
  for (StageBox& box : *boxes) {
    // These read whatever results there are, and come after all others.
    const bool last = box.stage == "gates" || box.stage == "report";
    layers[last ? static_cast<int>(boxes->size()) : box.layer].push_back(&box);
  }
  int row = 0;
  for (const auto& [layer, its] : layers) {
    for (size_t i = 0; i < its.size(); ++i) {
      its[i]->row = row + static_cast<int>(i) / most_beside;
      its[i]->place = static_cast<int>(i) % most_beside;
    }
    row = its.back()->row + 1;
  }
}

bool Needs(const Project& project, const std::string& stage, const StageTarget& target, const std::string& other) {
  try {
    return NeedsStage(project, StageNamed(stage), target, other);
  } catch (const Error&) {  // wrong options: the user is told when the project is opened
    const std::vector<std::string>& always = StageNamed(stage).needs;
    return std::find(always.begin(), always.end(), other) != always.end();
  }
}

}  // namespace

std::vector<StageBox> StageBoxesOf(const Project& project, const std::vector<SnapshotResult>& results) {
  std::vector<StageBox> boxes = BoxesWithoutNeeds(results);
  StageTarget target;
  for (const SnapshotResult& result : results) {
    if (target.run.empty() && StageNamed(result.stage).per_run && !result.run.empty()) target.run = result.run;
  }
  std::vector<std::set<size_t>> above(boxes.size());  // all that a box needs, directly or through others
  for (size_t b = 0; b < boxes.size(); ++b) {
    for (size_t a = b; a-- > 0;) {  // nearest first: what it needs in turn is needed through it
      if (!Needs(project, boxes[b].stage, target, boxes[a].stage)) continue;
      if (above[b].count(a) == 0) boxes[b].needs.push_back(a);
      above[b].insert(a);
      above[b].insert(above[a].begin(), above[a].end());
      boxes[b].layer = std::max(boxes[b].layer, boxes[a].layer + 1);
    }
  }
  return boxes;
}

StageGraph::StageGraph(QWidget* parent) : QWidget(parent) {
  setFocusPolicy(Qt::StrongFocus);
  setObjectName("run.graph");
  setAccessibleName(tr("Stages and what they need"));
}

void StageGraph::Show(std::vector<StageBox> boxes) {
  boxes_ = std::move(boxes);
  current_ = std::clamp(current_, 0, std::max(0, static_cast<int>(boxes_.size()) - 1));
  PlaceInRows(Beside(), &boxes_);
  Describe();
  updateGeometry();
  update();
}

void StageGraph::ShowStates(const std::vector<SnapshotResult>& results) {
  for (StageBox& now : BoxesWithoutNeeds(results)) {
    for (StageBox& box : boxes_) {
      if (box.stage != now.stage) continue;
      now.needs = box.needs, now.layer = box.layer, now.row = box.row, now.place = box.place;
      box = now;
    }
  }
  Describe();
  update();
}

void StageGraph::Describe() {
  QStringList said;
  for (const StageBox& box : boxes_) said << DescriptionOf(box);
  setAccessibleDescription(said.join("; "));
}

double StageGraph::NarrowWidth() const { return fontMetrics().horizontalAdvance(kNarrowText) + 2 * kPadding; }

int StageGraph::Beside() const {
  return std::clamp(static_cast<int>((width() - kGap) / (NarrowWidth() + kGap)), kLeastBeside, kMostBeside);
}

void StageGraph::resizeEvent(QResizeEvent*) {
  PlaceInRows(Beside(), &boxes_);
  updateGeometry();
}

int StageGraph::Columns() const {
  int columns = 1;
  for (const StageBox& box : boxes_) columns = std::max(columns, box.place + 1);
  return columns;
}

QFont StageGraph::SmallFont() const {
  QFont small = font();
  small.setPointSizeF(kSmall * small.pointSizeF());
  return small;
}

// As wide as there is room.
QRectF StageGraph::RectOf(size_t box) const {
  const double wide = fontMetrics().horizontalAdvance(kWideText) + 2 * kPadding;
  const double width_px = std::clamp((width() - kGap) / Columns() - kGap, NarrowWidth(), wide);
  const double high = fontMetrics().height() + 2 * QFontMetrics(SmallFont()).height() + 2 * kPadding;
  const StageBox& b = boxes_[box];
  return {kGap + b.place * (width_px + kGap), kGap + b.row * (high + kBetweenRows), width_px, high};
}

QSize StageGraph::minimumSizeHint() const {
  QRectF all(0, 0, 100, 40);
  for (size_t b = 0; b < boxes_.size(); ++b) all |= RectOf(b);
  return QSizeF(kGap + std::min(kLeastBeside, Columns()) * (NarrowWidth() + kGap), all.bottom() + kGap).toSize();
}

QSize StageGraph::sizeHint() const {
  const double wide = fontMetrics().horizontalAdvance(kWideText) + 2 * kPadding;
  return {static_cast<int>(kGap + Columns() * (wide + kGap)), minimumSizeHint().height()};
}

QString StageGraph::DoneText(const StageBox& box) {
  if (box.results == 1) return TextOfState(box.state);
  return tr("%1 of %2 done").arg(box.done).arg(box.results);
}

QString StageGraph::MetricText(const StageBox& box) const { return QString::fromStdString(box.metric.Text(unit_)); }

void StageGraph::SetUnit(const DisplayUnit& unit) {
  unit_ = unit;
  Describe();
  update();
}

QString StageGraph::DescriptionOf(const StageBox& box) const {
  QString text = QString::fromStdString(box.stage) + ": ";
  text += DoneText(box);
  if (box.results > 1 && box.state != "done") text += ", " + tr("worst: %1").arg(TextOfState(box.state));
  if (box.seconds > 0) text += ", " + DurationText(box.seconds);
  const StageMetric::Kind kind = box.metric.kind;
  if (kind == StageMetric::Kind::kNone) return text;
  text += ", " + MetricText(box);
  if (box.results > 1 && kind != StageMetric::Kind::kWord) {
    text += " " + (kind == StageMetric::Kind::kCount ? tr("in all") : tr("at most"));
  }
  return text;
}

void StageGraph::PaintArrow(QPainter* painter, const QRectF& from, const QRectF& to) const {
  const QPointF begin(from.center().x(), from.bottom()), end(to.center().x(), to.top());
  const QPointF bend(0, 0.5 * (end.y() - begin.y()));
  QPainterPath path(begin);
  path.cubicTo(begin + bend, end - bend, end);
  painter->setBrush(Qt::NoBrush);
  painter->drawPath(path);
  painter->drawLine(end, end + QPointF(-4, -6));
  painter->drawLine(end, end + QPointF(4, -6));
}

void StageGraph::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  painter.setPen(QPen(palette().color(QPalette::Mid), 1.5));
  for (size_t b = 0; b < boxes_.size(); ++b) {
    for (const size_t a : boxes_[b].needs) PaintArrow(&painter, RectOf(a), RectOf(b));
  }
  for (size_t b = 0; b < boxes_.size(); ++b) PaintBox(&painter, b);
}

// The stage; how far it is; its metric; its time in the first line that has room.
void StageGraph::PaintBox(QPainter* painter, size_t index) const {
  const StageBox& box = boxes_[index];
  const QRectF rect = RectOf(index);
  const QColor colour = ColourOfState(box.state);
  painter->setBrush(palette().color(QPalette::Base));
  painter->setPen(QPen(colour, static_cast<int>(index) == current_ && hasFocus() ? 3.5 : 2));
  painter->drawRoundedRect(rect, 4, 4);
  const QRectF inside = rect.adjusted(kPadding, kPadding, -kPadding, -kPadding);
  painter->setFont(font());
  painter->setPen(palette().color(QPalette::Text));
  painter->drawText(inside, Qt::AlignLeft | Qt::AlignTop, QString::fromStdString(box.stage));
  const QFontMetrics small(SmallFont());
  painter->setFont(SmallFont());
  const QString time = box.seconds > 0 ? DurationText(box.seconds) : QString();
  const QRectF second = inside.adjusted(0, fontMetrics().height(), 0, -small.height());
  const double time_px = time.isEmpty() ? 0 : small.horizontalAdvance(time + " ");
  const bool above = fontMetrics().horizontalAdvance(QString::fromStdString(box.stage)) + time_px < inside.width();
  painter->drawText(above ? inside.adjusted(0, fontMetrics().ascent() - small.ascent(), 0, 0) : second,
                    Qt::AlignRight | (above ? Qt::AlignTop : Qt::AlignVCenter), time);
  const auto fitting = [&](const QString& text, double less) {
    return small.elidedText(text, Qt::ElideRight, static_cast<int>(inside.width() - less));
  };
  painter->drawText(inside, Qt::AlignLeft | Qt::AlignBottom, fitting(MetricText(box), 0));
  painter->setPen(colour);
  painter->drawText(second, Qt::AlignLeft | Qt::AlignVCenter, fitting(DoneText(box), above ? 0 : time_px));
}

int StageGraph::BoxAt(const QPointF& at) const {
  for (size_t b = 0; b < boxes_.size(); ++b) {
    if (RectOf(b).contains(at)) return static_cast<int>(b);
  }
  return -1;
}

void StageGraph::SetCurrent(int box) {
  current_ = box;
  update();
}

bool StageGraph::event(QEvent* event) {
  if (event->type() != QEvent::ToolTip) return QWidget::event(event);
  const auto* help = static_cast<QHelpEvent*>(event);
  const int box = BoxAt(help->pos());
  QToolTip::showText(help->globalPos(), box < 0 ? tr("Each stage below those whose results it needs; click to choose")
                                                : DescriptionOf(boxes_[static_cast<size_t>(box)]));
  return true;
}

void StageGraph::mousePressEvent(QMouseEvent* event) {
  const int box = BoxAt(event->localPos());
  if (box < 0) return;
  SetCurrent(box);
  emit Chosen(QString::fromStdString(boxes_[static_cast<size_t>(box)].stage));
}

void StageGraph::keyPressEvent(QKeyEvent* event) {
  const int count = static_cast<int>(boxes_.size());
  if (count == 0) return QWidget::keyPressEvent(event);
  switch (event->key()) {
    case Qt::Key_Right:
    case Qt::Key_Down: return SetCurrent(std::min(count - 1, current_ + 1));
    case Qt::Key_Left:
    case Qt::Key_Up: return SetCurrent(std::max(0, current_ - 1));
    case Qt::Key_Return:
    case Qt::Key_Enter:
    case Qt::Key_Space: emit Chosen(QString::fromStdString(boxes_[static_cast<size_t>(current_)].stage)); return;
    default: QWidget::keyPressEvent(event);
  }
}

}  // namespace trigpoint
