// The stages of a project, drawn: what each needs, how far its results are, their main metric, and how long they took.
#pragma once

#include <QWidget>
#include <string>
#include <vector>

#include "app/desktop/snapshot.h"

namespace trigpoint {

// A stage with all of its results.
struct StageBox {
  std::string stage;
  std::string state;          // the worst of its results: failed, running, out of date, missing, done
  int results = 0, done = 0;  // those that are not needed do not count
  double seconds = 0;         // sum over the results that are there; 0: not known
  StageMetric metric;         // of several results the sum of a count, else the largest
  std::vector<size_t> needs;  // boxes, without those that are needed through others
  int layer = 0;              // below those of its needs
  int row = 0, place = 0;     // where it is drawn, from the top and from the left
};

// One box for each stage with a result that is needed; a box comes after those it needs.
std::vector<StageBox> StageBoxesOf(const Project& project, const std::vector<SnapshotResult>& results);

class StageGraph : public QWidget {
  Q_OBJECT

 public:
  explicit StageGraph(QWidget* parent = nullptr);
  void Show(std::vector<StageBox> boxes);
  // In which metrics that are lengths are said.
  void SetUnit(const DisplayUnit& unit);
  // The same stages, with what became of their results.
  void ShowStates(const std::vector<SnapshotResult>& results);
  const std::vector<StageBox>& boxes() const { return boxes_; }
  QRectF RectOf(size_t box) const;
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 signals:
  void Chosen(const QString& stage);  // by a click, or the return key

 protected:
  bool event(QEvent* event) override;
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;

 private:
  int BoxAt(const QPointF& at) const;  // -1: none
  static QString DoneText(const StageBox& box);
  QString MetricText(const StageBox& box) const;
  QString DescriptionOf(const StageBox& box) const;
  void Describe();  // for those who do not see it
  int Columns() const;
  int Beside() const;  // boxes that have room beside each other
  double NarrowWidth() const;
  QFont SmallFont() const;
  void PaintBox(QPainter* painter, size_t box) const;
  void PaintArrow(QPainter* painter, const QRectF& from, const QRectF& to) const;
  void SetCurrent(int box);

  std::vector<StageBox> boxes_;
  DisplayUnit unit_;
  int current_ = 0;
};

}  // namespace trigpoint
