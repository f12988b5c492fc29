// Decisions of the review, from wherever an object is shown: exclude, restore, change the role; taken back and made
// again. The same as `trigpoint review`.
#pragma once

#include <QObject>
#include <QString>
#include <QStringList>
#include <vector>

#include "app/desktop/workspace.h"
#include "datasets/project/review.h"

class QMenu;

namespace trigpoint {

// States that the review excludes an object, and why; empty if it does not. `others`: also the objects that belong to
// it, each with its name. As long as a result is out of date, the text says that the numbers do not show it yet.
QString ExclusionText(const Workspace& workspace, const std::string& object, bool others);

class Decisions : public QObject {
  Q_OBJECT

 public:
  explicit Decisions(Workspace* workspace, QObject* parent = nullptr);

  // "exclude", "restore", "role"; Decided or a Problem of the workspace follows.
  void Decide(const QString& action, const QString& object, const QString& reason);
  // The last decision in force is taken back; the last one taken back here is made again, with its reason.
  void Undo();
  void Redo();
  // What they would do, in words; empty: nothing.
  QString UndoText() const;
  QString RedoText() const;
  // Whether the last decision was one that is made again.
  bool again() const { return again_; }
  // Whose decisions they are; empty: the user of this process.
  void SetUser(const QString& user) { user_ = user; }

  // What can be decided of an object and of what belongs to it, each with reasons to pick.
  void AddTo(QMenu* menu, const QString& object);
  // The usual ones for an action on a kind of object, then those given lately.
  QStringList Reasons(const QString& action, const QString& kind) const;

 signals:
  void Decided();  // review.jsonl has a new entry, and the project was read again
  void Changed();  // what can be undone or made again

 private:
  void Append(const ReviewRequest& request, bool again);
  void AddAction(QMenu* menu, const QString& action, const QString& object);
  void AskReason(const QString& action, const QString& object);

  Workspace* workspace_;
  QString user_;
  std::vector<ReviewEntry> undone_;  // the last one is made again first
  bool busy_ = false;
  bool again_ = false;
};

}  // namespace trigpoint
