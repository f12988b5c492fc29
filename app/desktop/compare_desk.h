// Two evaluations side by side: variants, runs, releases, other projects; in tables and in 3D, with what changed.
#pragma once

#include <QWidget>
#include <filesystem>
#include <vector>

#include "app/desktop/workspace.h"
#include "eval/scene/scene_model.h"

class QCheckBox;
class QComboBox;
class QLabel;
class QTableWidget;
class QTabWidget;
class QTextBrowser;

namespace trigpoint {

struct ReviewedError;
class SceneDesk;

class CompareDesk : public QWidget {
  Q_OBJECT

 public:
  explicit CompareDesk(Workspace* workspace, QWidget* parent = nullptr);
  // A folder with errors.csv, of any project; false if there is none.
  bool Add(const QString& folder);

 signals:
  void Compared();
  void Activated(const QString& object);  // a row was opened: show what it is about

 private:
  struct Side {
    QComboBox *result = nullptr, *run = nullptr;
    QLabel* title = nullptr;            // of the scene
    std::optional<SceneSource> source;  // nothing where errors stand alone
    SceneDesk* scene = nullptr;
  };
  void Refresh();
  void Compare();
  void ShowErrors(const std::vector<ReviewedError>& rows, bool single);
  void ShowScenes();
  void ShowTitles();               // of the scenes
  void Note(const QString& text);  // what is compared, or why nothing is

  Workspace* workspace_;
  std::vector<std::filesystem::path> added_;
  Side sides_[2];
  QCheckBox* views_;  // also the answers of single views
  QTabWidget* tabs_;
  QTableWidget *errors_, *differences_;
  QTextBrowser* text_;
  QWidget* scenes_;
  QLabel* note_;
  int generation_ = 0;
};

}  // namespace trigpoint
