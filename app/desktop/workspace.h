// What all desks share: the open project, the selected object, the unit lengths are shown in. Lives in the window's
// thread.
#pragma once

#include <QObject>
#include <QPoint>
#include <QString>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "app/desktop/snapshot.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct SharedInspector;

class Workspace : public QObject {
  Q_OBJECT

 public:
  explicit Workspace(QObject* parent = nullptr) : QObject(parent) {}

  // Reads the folder in the background; Opened or Problem follows.
  void Open(const QString& dir);
  // Again, after a run or a review: keeps the selection. While another one is opened: after that, if it is still this
  // one.
  void Reload();
  void Close();

  // Null while nothing is open.
  const std::shared_ptr<const Snapshot>& snapshot() const { return snapshot_; }
  const std::vector<SnapshotResult>& results() const { return results_; }
  // Finds out again which results are out of date, after an input was changed.
  void CheckStates();
  // Of a result ("localize/run1") while a run goes on; the next reading of the project has the last word.
  void SetState(const QString& title, const QString& state, const QString& reason = "");
  QString dir() const;
  bool opening() const { return opening_ > 0; }
  // Of the snapshot's results; the same one until a new snapshot is there. Throws InputError for an unknown run.
  std::shared_ptr<SharedInspector> InspectorOf(const std::string& run, const std::string& variant = "");

  const QString& selected() const { return selected_; }
  // The selected object and what belongs to it.
  const std::set<std::string>& related() const { return related_; }
  // The run of the cell or row by which the object was selected; empty if that has no run.
  const QString& run() const { return run_; }
  void Select(const QString& object, const QString& run = "");
  // Selects it, and asks for its menu at a place of the screen.
  void AskMenu(const QString& object, const QPoint& at);

  // "m", "ft", "us-ft".
  QString unit() const { return QString::fromStdString(unit_.name); }
  double metres_per_unit() const { return unit_.metres; }
  const DisplayUnit& display_unit() const { return unit_; }
  void SetUnit(const QString& name);
  // "1.234 m" in the unit shown.
  QString Length(double metres, int decimals = 3) const;

 signals:
  void Replaced();        // another project than before is open, or none: nothing of the old one may stay on a desk
  void Opened();          // a snapshot is there, or a new one of the same project
  void ResultsChanged();  // states of results are known
  void StateChanged(int result);  // of one, by SetState
  void Closed();
  void Selected(const QString& object);
  void MenuAsked(const QString& object, const QPoint& at);
  void UnitChanged();
  // One readable sentence and what stands behind it.
  void Problem(const QString& sentence, const QString& details);

 private:
  void Load(const QString& dir, bool again);

  std::shared_ptr<const Snapshot> snapshot_;
  std::vector<SnapshotResult> results_;
  std::map<std::string, SnapshotResult> live_;  // by title: those with a state set since the project was read
  std::map<std::string, std::shared_ptr<SharedInspector>> inspectors_;  // by run@variant
  QString selected_, run_;
  std::set<std::string> related_;
  DisplayUnit unit_;
  int opening_ = 0;
  bool again_ = false;   // what is opened is the same project again
  bool reload_ = false;  // asked for while a project was opened
  int generation_ = 0;
  int states_ = 0;  // how often states were asked for: an answer to an earlier question is not shown
};

}  // namespace trigpoint
