#include "app/desktop/match_lines.h"

#include <QEvent>
#include <QPainter>
#include <algorithm>

#include "app/desktop/picture_view.h"

namespace trigpoint {

MatchLines::MatchLines(PictureView* first, PictureView* second, QWidget* parent)
    : QWidget(parent), first_(first), second_(second) {
  setAttribute(Qt::WA_TransparentForMouseEvents);
  setFocusPolicy(Qt::NoFocus);
  parent->installEventFilter(this);
  for (PictureView* view : {first, second}) {
    connect(view, &PictureView::ViewChanged, this, QOverload<>::of(&QWidget::update));
  }
  setGeometry(parent->rect());
}

void MatchLines::SetPairs(std::vector<MatchPair> pairs) {
  pairs_ = std::move(pairs);
  setVisible(!pairs_.empty());
  raise();
  update();
}

bool MatchLines::Ends(const MatchPair& pair, QPointF* first, QPointF* second) const {
  const auto end = [this](const PictureView* view, const QPointF& pixel, QPointF* at) {
    const QPointF inside = view->WidgetAt(pixel);
    *at = inside + QPointF(view->mapTo(parentWidget(), QPoint(0, 0)));
    return QRectF(view->rect()).contains(inside);
  };
  return end(first_, pair.first, first) && end(second_, pair.second, second);
}

int MatchLines::InSight() const {
  QPointF first, second;
  return static_cast<int>(
      std::count_if(pairs_.begin(), pairs_.end(), [&](const MatchPair& pair) { return Ends(pair, &first, &second); }));
}

void MatchLines::paintEvent(QPaintEvent*) {
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  for (const MatchPair& pair : pairs_) {
    QPointF first, second;
    if (!Ends(pair, &first, &second)) continue;
    painter.setPen(QPen(pair.colour, 1));
    painter.drawLine(first, second);
  }
}

bool MatchLines::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::Resize || event->type() == QEvent::LayoutRequest ||
      event->type() == QEvent::ChildAdded) {
    setGeometry(parentWidget()->rect());
    raise();
  }
  return QWidget::eventFilter(watched, event);
}

}  // namespace trigpoint
