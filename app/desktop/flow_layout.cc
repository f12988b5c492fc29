#include "app/desktop/flow_layout.h"

#include <QWidget>
#include <algorithm>

namespace trigpoint {

namespace {

constexpr int kGap = 6;

}  // namespace

FlowLayout::FlowLayout(QWidget* parent) : QLayout(parent) { setContentsMargins(0, 0, 0, 0); }

FlowLayout::~FlowLayout() {
  for (QLayoutItem* item : items_) delete item;
}

void FlowLayout::addItem(QLayoutItem* item) { items_.push_back(item); }

int FlowLayout::count() const { return static_cast<int>(items_.size()); }

QLayoutItem* FlowLayout::itemAt(int index) const {
  return index >= 0 && index < count() ? items_[static_cast<size_t>(index)] : nullptr;
}

QLayoutItem* FlowLayout::takeAt(int index) {
  QLayoutItem* item = itemAt(index);
  if (item != nullptr) items_.erase(items_.begin() + index);
  return item;
}

int FlowLayout::heightForWidth(int width) const { return Arrange(QRect(0, 0, width, 0), false); }

QSize FlowLayout::sizeHint() const {
  int width = -kGap, height = 0;
  for (const QLayoutItem* item : items_) {
    if (item->isEmpty()) continue;
    width += item->sizeHint().width() + kGap;
    height = std::max(height, item->sizeHint().height());
  }
  return {std::max(0, width), height};
}

QSize FlowLayout::minimumSize() const {
  QSize size(0, 0);
  for (const QLayoutItem* item : items_) {
    if (!item->isEmpty()) size = size.expandedTo(item->minimumSize());
  }
  return size;
}

void FlowLayout::setGeometry(const QRect& rect) {
  QLayout::setGeometry(rect);
  Arrange(rect, true);
}

int FlowLayout::Arrange(const QRect& rect, bool move) const {
  const auto grows = [](const QLayoutItem* item, Qt::Orientation way) {
    return (item->expandingDirections() & way) != 0;
  };
  const auto least = [&](const QLayoutItem* item) { return std::min(item->sizeHint().width(), rect.width()); };
  int y = rect.y();
  for (size_t first = 0; first < items_.size();) {
    // The items of a line, and what is left of it for those that take more.
    size_t end = first;
    int used = 0, growing = 0;
    for (; end < items_.size(); ++end) {
      const QLayoutItem* item = items_[end];
      if (item->isEmpty()) continue;
      const int with = used + (used > 0 ? kGap : 0) + least(item);
      if (used > 0 && with > rect.width()) break;
      used = with;
      growing += grows(item, Qt::Horizontal) ? 1 : 0;
    }
    const int more = growing > 0 ? std::max(0, rect.width() - used) / growing : 0;
    const auto size = [&](QLayoutItem* item) {
      const int width = least(item) + (grows(item, Qt::Horizontal) ? more : 0);
      return QSize(width, item->hasHeightForWidth() ? item->heightForWidth(width) : item->sizeHint().height());
    };
    int height = 0;
    for (size_t i = first; i < end; ++i) {
      if (!items_[i]->isEmpty()) height = std::max(height, size(items_[i]).height());
    }
    int x = rect.x();
    for (; first < end; ++first) {
      QLayoutItem* item = items_[first];
      if (item->isEmpty()) continue;
      const QSize own = size(item);
      const int high = grows(item, Qt::Vertical) ? height : own.height();
      if (move) item->setGeometry(QRect(x, y + (height - high) / 2, own.width(), high));
      x += own.width() + kGap;
    }
    y += height + kGap;
  }
  return std::max(0, y - kGap - rect.y());
}

}  // namespace trigpoint
