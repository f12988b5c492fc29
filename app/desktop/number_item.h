// A cell that sorts as a number; empty ones come last in either order.
#pragma once

#include <QHeaderView>
#include <QTableWidget>

namespace trigpoint {

class NumberItem : public QTableWidgetItem {
 public:
  explicit NumberItem(const QString& text) : QTableWidgetItem(text) {
    setTextAlignment(static_cast<int>(Qt::AlignRight | Qt::AlignVCenter));
  }
  bool operator<(const QTableWidgetItem& other) const override {
    if (text().isEmpty() != other.text().isEmpty()) {
      const QTableWidget* table = tableWidget();
      const bool down = table != nullptr && table->horizontalHeader()->sortIndicatorOrder() == Qt::DescendingOrder;
      return text().isEmpty() == down;
    }
    return text().toDouble() < other.text().toDouble();
  }
};

}  // namespace trigpoint
