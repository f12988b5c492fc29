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
class QTableWidgetItem;
class QVBoxLayout;

namespace trigpoint {

struct ErrorRecord;
struct Overview;
struct OverviewAnswer;
class PictureView;

class OverviewDesk : public QWidget {
  Q_OBJECT

 public:
  explicit OverviewDesk(Workspace* workspace, QWidget* parent = nullptr);
  PictureView* plan() const { return plan_; }
  // Null until it is read.
  const std::shared_ptr<const Overview>& overview() const { return overview_; }

 signals:
  void Loaded();  // what is there is shown
  void SceneRequested(const QString& object);
  void LookRequested(const QString& object);  // the scene is to look at it, whenever it is seen
  void RunRequested();                        // all that is out of date
  void ReportRequested();
  void CreateRequested(const QString& dir);   // write trigpoint.yaml
  void ProjectRequested(const QString& dir);  // open it
  void OpenRequested();                       // choose a folder
  void ExampleRequested();                    // copy the embedded site, and open it

 protected:
  void resizeEvent(QResizeEvent* event) override;
  void changeEvent(QEvent* event) override;

 private:
  // Where one reads, and where the keyboard is, within what is scrolled.
  struct Place {
    QString focus;  // a widget's name; empty: elsewhere
    int scrolled = 0, row_scrolled = 0, column = -1;
  };

  void Load();
  void Show();
  Place PlaceNow() const;  // of what is shown
  void ReturnTo(const Place& place);
  void ShowWelcome(QVBoxLayout* column);
  void SaveThumbnail() const;  // of the plan, for the welcome page
  void ShowVerdict(QVBoxLayout* column);
  void ShowMatrix(QVBoxLayout* column);
  void FillMatrix();
  QTableWidgetItem* MatrixItem(const ErrorRecord& error) const;
  QTableWidgetItem* AnswerItem(const OverviewAnswer& answer) const;
  QString Elided(const QString& reason) const;
  QString SigmaText(double sigma_m) const;
  bool HasReference() const;  // the matrix is of errors at stations; else of panoramas' answers
  int Rows() const;           // of the matrix
  QString RowTitle(int row) const;
  QString RowObject(int row) const;  // that a row of the matrix is about
  QString RowExclusion(int row) const;
  void ShowRowHeader();
  void ShowFolder(QVBoxLayout* column);
  void ShowWarnings(QVBoxLayout* column);
  QString WarningsText(size_t most) const;
  void ShowPlan();
  void ShowNext();
  void ShowSelected();                                          // the plan's mark, the matrix' row
  void Choose(const QString& object, const QString& run = "");  // selects it, and asks to look at it
  void Follow(const QString& anchor);

  Workspace* workspace_;
  std::shared_ptr<const Overview> overview_;
  Place place_;  // to return to, once what is shown has its size
  bool returning_ = false;
  QLabel* title_;
  QLabel* next_text_;
  QPushButton* next_;
  QScrollArea* scroll_;
  QSplitter* split_;
  PictureView* plan_;
  QTableWidget* matrix_ = nullptr;  // of what is shown now
  bool showing_ = false;
  bool recolouring_ = false;
  int generation_ = 0;
};

}  // namespace trigpoint
