// Stages from the window: what to run, with which options, how far it is, its log, and the same as a command line.
#pragma once

#include <QElapsedTimer>
#include <QWidget>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "app/desktop/job_controller.h"
#include "app/desktop/workspace.h"

class QComboBox;
class QLabel;
class QLineEdit;
class QListWidget;
class QPlainTextEdit;
class QProgressBar;
class QPushButton;
class QScrollArea;
class QSpinBox;
class QTableWidget;

namespace trigpoint {

class StageForm;
class StageGraph;

// "3:20", "1:02:00".
QString DurationText(double seconds);
// Calls `start` at once, or where much would be computed again when that was asked (run.ask) and answered with yes.
void StartAsked(QWidget* window, const Workspace& workspace, const JobQuery& query, const std::function<void()>& start,
                quint64 seed = 1);

class RunDesk : public QWidget {
  Q_OBJECT

 public:
  RunDesk(Workspace* workspace, JobController* jobs, QWidget* parent = nullptr);

  // Chooses a stage (empty: what `trigpoint run` makes, as it does it), a run or photo set (empty: all), a variant.
  void Choose(const QString& stage, const QString& run, const std::optional<QString>& variant = std::nullopt);

 public slots:
  void Run();

 private:
  void MakeControls();
  void Arrange();
  void ConnectJobs();
  JobQuery Query() const;
  void Refresh();    // after a project was opened
  void Forget();     // before another one is
  void ShowStage();  // the form of the chosen stage
  void ListNames();  // runs, photo sets or calibrations, whatever the chosen stage has results for
  void ShowCommand();
  void ShowProgress(const QString& job, const QString& task, qint64 done, qint64 total, double seconds_left);
  void ShowEnd(JobController::End end, const QString& error);
  void ShowResults();
  QString LeftText(double job) const;  // of all of the run; empty: not known, or no more than the `job` seconds left
  void Expect();                       // what a run that begins takes
  void ShowResult(int result);         // its state
  void Say(const QString& line);
  QString Whose() const;  // "Project NAME: " where the run is of another project than the one that is open

  Workspace* workspace_;
  JobController* jobs_;
  QComboBox* stage_;
  QLabel* runs_label_;
  QLabel* variant_label_;
  QString listed_;  // of which stage the names are listed
  QListWidget* runs_;
  QComboBox* variant_;
  QSpinBox* threads_;
  QSpinBox* seed_;
  StageForm* form_;
  std::map<std::string, std::map<std::string, QString>> edits_;  // options that were typed, by stage
  QLineEdit* command_;
  QLabel* problem_;
  QScrollArea* scroll_;
  QPushButton *run_, *cancel_, *copy_, *reset_;
  QProgressBar* bar_;
  QLabel* status_;
  QPlainTextEdit* log_;
  QLabel* expected_;
  QTableWidget* results_;  // of all stages, with their states
  StageGraph* graph_;      // the same, drawn
  // Of the run that goes on.
  std::map<std::string, double> pending_;  // seconds that jobs which have not ended took the last time
  bool at_least_ = false;                  // it makes others, too
  std::string job_;
  QElapsedTimer since_;  // the job began
};

}  // namespace trigpoint
