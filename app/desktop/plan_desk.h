// A survey before the trip: tags, control, stations and paths are drawn on the plan, `trigpoint plan` predicts what
// accuracy a survey of them would state, and what one more of each would gain.
#pragma once

#include <QWidget>
#include <memory>
#include <optional>

#include "app/desktop/job_controller.h"
#include "app/desktop/plan_ground.h"
#include "app/desktop/workspace.h"

class QComboBox;
class QDoubleSpinBox;
class QLabel;
class QPushButton;
class QSpinBox;
class QSplitter;
class QTableWidget;
class QTableWidgetItem;

namespace trigpoint {

class PlanDesk : public QWidget {
  Q_OBJECT

 public:
  PlanDesk(Workspace* workspace, JobController* jobs, QWidget* parent = nullptr);

  const Sketch& sketch() const { return sketch_; }
  const PlanGround& ground() const { return ground_; }
  PictureView* map() const { return map_; }
  // "select", "tag", "candidate", "control", "check", "station", "path".
  void ChooseTool(const QString& tool);
  // Saves the sketch and predicts with it. Nothing while another job goes on.
  void Predict();
  // False if it could not be saved, which was said.
  bool Save();
  // The sketch as it was saved last.
  void Discard() { Read(); }
  void Undo();
  void Redo();
  // What they would do, in words; empty: nothing.
  QString UndoText() const;
  QString RedoText() const;

 signals:
  void Changed();  // what can be undone or made again
  void OptionsRequested();

 protected:
  void resizeEvent(QResizeEvent* event) override;

 private:
  void MakeWidgets();
  void Arrange();
  void Connect();
  void Read();  // sketch and prediction of the open project
  void ReadPrediction();
  void Click(const QPointF& pixel, const QString& object);
  void AddTag(const Eigen::Vector2d& place);
  void AddStation(const Eigen::Vector2d& place);
  void AddCorner(const Eigen::Vector2d& place);
  void ToggleKnown(const QString& object);  // control or check point on a tag
  void RemoveSelected();
  void Edit(QTableWidgetItem* cell);
  void AdoptProposal();
  void Show();  // ground, marks, items, buttons
  void ShowItems();
  void ShowMap();
  void HeadPrediction(bool proposed);  // its tables; of places proposed, or of one more of each
  void ShowPrediction();
  void ShowButtons();
  void ShowUnit();
  void ShowSelected();  // on any desk: the item, its mark
  static QString ObjectOf(const SketchItem& item);
  int Selected() const;  // index of the item; -1: none
  std::optional<size_t> IndexOf(const QString& object) const;
  QString Length(double metres, int decimals) const;

  Workspace* workspace_;
  JobController* jobs_;
  Sketch sketch_;
  PlanGround ground_;
  std::vector<PlannedEllipse> ellipses_;
  std::vector<PlannedPlace> places_;
  QString tool_ = "select", path_;  // the path that is drawn; empty: the next corner begins one
  std::optional<size_t> facing_;    // the tag whose direction the next click gives
  bool ended_path_ = false;         // by a double click, whose second click adds nothing
  double metres_ = 1;               // in a unit of the height that is shown
  bool stale_ = false;              // the sketch was changed after the prediction
  QString trouble_;                 // why sketch or aerial image cannot be shown
  QLabel *hint_, *prediction_;
  std::vector<QPushButton*> tools_;
  QPushButton *remove_, *undo_, *redo_, *save_, *predict_, *options_, *page_, *adopt_;
  QComboBox* suggest_;
  QSpinBox* count_;
  QDoubleSpinBox *height_, *size_;
  QTableWidget *items_, *tags_, *gains_;
  PictureView* map_;
  QSplitter* split_;
};

}  // namespace trigpoint
