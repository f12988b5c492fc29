#include "app/desktop/thumbnails.h"

#include <QPixmap>
#include <QScrollBar>

#include "app/desktop/background.h"

namespace trigpoint {

namespace {

constexpr int kLook_ms = 120;      // after the list was scrolled
constexpr size_t kMostKept = 500;  // of a long run only these stay

}  // namespace

Thumbnails::Thumbnails(QListWidget* list) : QObject(list), list_(list) {
  list_->setIconSize(QSize(64, 48));
  QPixmap nothing(list_->iconSize());
  nothing.fill(Qt::transparent);
  nothing_ = QIcon(nothing);
  timer_.setSingleShot(true);
  timer_.setInterval(kLook_ms);
  connect(&timer_, &QTimer::timeout, this, &Thumbnails::Look);
  const auto soon = [this] { timer_.start(); };
  connect(list_->verticalScrollBar(), &QScrollBar::valueChanged, this, soon);
  connect(list_->verticalScrollBar(), &QScrollBar::rangeChanged, this, soon);
  connect(list_->model(), &QAbstractItemModel::rowsInserted, this, [this](const QModelIndex&, int first, int last) {
    for (int row = first; row <= last; ++row) list_->item(row)->setIcon(nothing_);  // rows keep their height
    timer_.start();
  });
}

void Thumbnails::SetSource(Load load) {
  ++generation_;
  load_ = std::move(load);
  asked_.clear();
  timer_.start();
}

void Thumbnails::Look() {
  if (!load_ || !list_->isVisible()) return;
  const QModelIndex top = list_->indexAt(QPoint(2, 2)),
                    bottom = list_->indexAt(QPoint(2, list_->viewport()->height() - 2));
  const int first = std::max(0, top.row()), last = bottom.isValid() ? bottom.row() : list_->count() - 1;
  if (asked_.size() > kMostKept) {
    for (int row = 0; row < list_->count(); ++row) {
      if (row < first || row > last) list_->item(row)->setIcon(nothing_);
    }
    asked_.clear();
  }
  for (int row = first; row <= last && row < list_->count(); ++row) {
    const QString text = list_->item(row)->text();
    if (!asked_.insert(text).second) continue;
    InBackground(
        this, [load = load_, text] { return load(text); },
        [this, row, text, generation = generation_](const Attempted<QImage>& image) {
          QListWidgetItem* item = generation == generation_ ? list_->item(row) : nullptr;
          if (item == nullptr || item->text() != text || image.value.isNull()) return;
          item->setIcon(QIcon(QPixmap::fromImage(image.value)));
        });
  }
}

}  // namespace trigpoint
