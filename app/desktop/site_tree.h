// The tree of a project: runs, panoramas, photo sets, stations, tags, control points, results with their state.
#pragma once

#include <QColor>
#include <QTreeWidget>

#include "app/desktop/workspace.h"

namespace trigpoint {

// Of a result's state: "done", "failed", "out of date", "running", others.
QColor ColourOfState(const std::string& state);
// In the window's language; of one that is not known yet "checking ...".
QString TextOfState(const std::string& state);

class SiteTree : public QTreeWidget {
  Q_OBJECT

 public:
  explicit SiteTree(Workspace* workspace, QWidget* parent = nullptr);

  // The state shown for a result ("localize/run1"), for tests; empty if it isn't listed.
  QString StateOf(const QString& title) const;
  // Of a result while a run goes on; the next reading of the project has the last word.
  void SetState(const QString& title, const QString& state);

 signals:
  void Activated(const QString& object);                                                // show it
  void RunRequested(const QString& stage, const QString& run, const QString& variant);  // a result was opened

 private:
  void Refresh();
  void ShowStates();
  void FillResults();
  void AskForRun(const QTreeWidgetItem* result);
  void ShowSelected();
  QTreeWidgetItem* ResultItem(const QString& title) const;
  QTreeWidgetItem* AddGroup(const QString& text);
  QTreeWidgetItem* AddObject(QTreeWidgetItem* group, const QString& text, const QString& object);
  void Menu(const QPoint& at);

  Workspace* workspace_;
  QTreeWidgetItem* results_ = nullptr;
  bool showing_ = false;
};

}  // namespace trigpoint
