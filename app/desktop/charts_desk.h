// The report's charts on the screen, linked with the other desks: a mark selects what it stands for, what is selected
// elsewhere is marked.
#pragma once

#include <QWidget>
#include <memory>
#include <vector>

#include "app/desktop/charts.h"
#include "app/desktop/workspace.h"

class QLabel;
class QListWidget;

namespace trigpoint {

class PictureView;

// A drawing with its spots as marks that can be clicked and are seen when they are selected.
void ShowDrawing(PictureView* view, const PaintedDrawing& drawing, const QString& title);
// The mark of the selected object, else of what belongs to it.
void HighlightSelected(PictureView* view, const Workspace& workspace);

class ChartsDesk : public QWidget {
  Q_OBJECT

 public:
  explicit ChartsDesk(Workspace* workspace, QWidget* parent = nullptr);
  PictureView* view() const { return view_; }
  // By the name of the report's figure ("tag_residuals"); false if there is no such chart.
  bool Choose(const QString& name);

 signals:
  void Loaded();
  void Activated(const QString& object);

 protected:
  void showEvent(QShowEvent* event) override;

 private:
  void Load();
  void ShowChart();
  void ShowSelected();
  void MarkBars();                       // those with what is selected
  const NamedChart* Chosen() const;      // null: none
  void ListGroup(const QPointF& pixel);  // what is in the bar there, to select
  void Save();

  Workspace* workspace_;
  std::vector<NamedChart> charts_;
  QListWidget* list_;
  PictureView* view_;
  QLabel* caption_;
  bool stale_ = false;  // to be loaded when it is seen
  int generation_ = 0;
};

}  // namespace trigpoint
