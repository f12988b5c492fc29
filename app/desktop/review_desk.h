// The review: decide, take back, re-solve, and see what that changed at stations and check points.
#pragma once

#include <QWidget>
#include <vector>

#include "app/desktop/job_controller.h"
#include "app/desktop/workspace.h"

class QComboBox;
class QLabel;
class QLineEdit;
class QPushButton;
class QTableWidget;

namespace trigpoint {

class Decisions;
struct ErrorRow;

class ReviewDesk : public QWidget {
  Q_OBJECT

 public:
  ReviewDesk(Workspace* workspace, JobController* jobs, Decisions* decisions, QWidget* parent = nullptr);
  ~ReviewDesk() override;

 public slots:
  void Solve();

 signals:
  void Reviewed();  // review.jsonl has a new entry, and the project was read again
  void Solved();    // the changes are shown

 private:
  void Refresh();
  void Forget();  // before another project is opened
  void Decide(const char* action);
  void ShowChanges();

  Workspace* workspace_;
  JobController* jobs_;
  Decisions* decisions_;
  QLineEdit *object_, *reason_, *user_;
  QComboBox* variant_;
  QPushButton *exclude_, *restore_, *role_, *undo_, *redo_, *solve_;
  QTableWidget *entries_, *changes_;
  QLabel* summary_;
  std::vector<ErrorRow> before_;
  std::string solving_variant_;
  bool solving_ = false;
};

}  // namespace trigpoint
