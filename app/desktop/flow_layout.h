// Widgets side by side, in as many lines as they need: no row of buttons makes the window wider than the screen.
#pragma once

#include <QLayout>
#include <vector>

namespace trigpoint {

class FlowLayout : public QLayout {
 public:
  explicit FlowLayout(QWidget* parent = nullptr);
  ~FlowLayout() override;

  void addItem(QLayoutItem* item) override;
  int count() const override;
  QLayoutItem* itemAt(int index) const override;
  QLayoutItem* takeAt(int index) override;
  Qt::Orientations expandingDirections() const override { return {}; }
  bool hasHeightForWidth() const override { return true; }
  int heightForWidth(int width) const override;
  QSize sizeHint() const override;
  QSize minimumSize() const override;
  void setGeometry(const QRect& rect) override;

 private:
  // Lays the items out within `rect`; returns the height they take.
  int Arrange(const QRect& rect, bool move) const;

  std::vector<QLayoutItem*> items_;
};

}  // namespace trigpoint
