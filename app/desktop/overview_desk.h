// The desk a project opens on: how good it is, where, what is wrong, and what to do next.
#pragma once

#include <QWidget>
#include <memory>

#include "app/desktop/workspace.h"

class QLabel;
class QPushButton;
class QScrollArea;
class QSplitter;
class QTableWidget;
class QVBoxLayout;

namespace trigpoint {

struct Overview;
class PictureView;

class OverviewDesk : public QWidget {
  Q_OBJECT

 public:
  explicit OverviewDesk(Workspace* workspace, QWidget* parent = nullptr);
  PictureView* plan() const { return plan_; }

 signals:
  void Loaded();                          // what is there is shown
  void Activated(const QString& object);  // show its image
  void SceneRequested(const QString& object);
  void ReviewRequested(const QString& object);
  void RunRequested();  // all that is out of date
  void ReportRequested();
  void CreateRequested(const QString& dir);   // write trigpoint.yaml
  void ProjectRequested(const QString& dir);  // open it
  void OpenRequested();                       // choose a folder

 protected:
  void resizeEvent(QResizeEvent* event) override;

 private:
  void MakeCard();
  void Load();
  void Show();
  void ShowWelcome(QVBoxLayout* column);
  void ShowVerdict(QVBoxLayout* column);
  void ShowMatrix(QVBoxLayout* column);
  void ShowFolder(QVBoxLayout* column);
  void ShowWarnings(QVBoxLayout* column);
  void ShowPlan();
  void ShowNext();
  void ShowSelected();  // the plan's mark, the matrix' row, the card
  void ShowCard();
  void Follow(const QString& anchor);

  Workspace* workspace_;
  std::shared_ptr<const Overview> overview_;
  QLabel* title_;
  QLabel* next_text_;
  QPushButton* next_;
  QScrollArea* scroll_;
  QSplitter* split_;
  PictureView* plan_;
  QTableWidget* matrix_ = nullptr;  // of what is shown now
  QLabel* card_title_;
  QTableWidget* card_;
  QWidget* card_buttons_;
  QString shown_;  // whose card is shown
  bool showing_ = false;
  int generation_ = 0;
};

}  // namespace trigpoint
