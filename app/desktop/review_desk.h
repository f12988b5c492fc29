// The review: decide, take back, re-solve, and see what that changed at stations and check points.
#pragma once

#include <QWidget>
#include <filesystem>
#include <vector>

#include "app/desktop/job_controller.h"
#include "app/desktop/workspace.h"

class QCheckBox;
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
  void Solve();  // asks before what takes long

 signals:
  void Reviewed();  // review.jsonl has a new entry, and the project was read again
  void Solved();    // the changes are shown

 private:
  void Connect();
  QWidget* MakeChanges();  // what re-solving changed
  void Refresh();
  void Forget();  // before another project is opened
  void Decide(const char* action);
  void StartSolving();
  void ShowChanges();
  std::string StateInForce() const;

  Workspace* workspace_;
  JobController* jobs_;
  Decisions* decisions_;
  QLineEdit *object_, *reason_, *user_;
  QComboBox* variant_;
  QCheckBox *small_changes_, *views_;
  QPushButton *exclude_, *restore_, *role_, *undo_, *redo_, *solve_;
  QTableWidget *entries_, *changes_;
  QLabel *summary_, *empty_;
  QWidget* body_;  // all but what is said without a project
  std::vector<ErrorRow> before_;
  std::string solving_variant_;
  // What was in force when the results were made, and before that: taken back, the earlier results are still there.
  std::string solved_state_, earlier_state_, opened_state_;
  std::filesystem::path opened_;
  bool solving_ = false;
  bool solved_ = false;  // since the project was opened: what changed is shown
  QString failure_;      // of the last re-solve; empty: it went well
};

}  // namespace trigpoint
