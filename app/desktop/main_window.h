// The workstation's window: the site on the left, the desks as tabs, problems above, progress below.
#pragma once

#include <QIcon>
#include <QMainWindow>
#include <functional>
#include <vector>

#include "app/desktop/job_controller.h"
#include "app/desktop/workspace.h"

class QDockWidget;
class QLabel;
class QMenu;
class QPushButton;
class QTabWidget;
class QTimer;

namespace trigpoint {

class CalibrationDesk;
struct Action;
class ChartsDesk;
class CheckDesk;
class CompareDesk;
class Decisions;
class ImagesDesk;
class OverviewDesk;
class PanoramaDesk;
class PlanDesk;
class PrintDesk;
class ProblemBar;
class ReviewDesk;
class RunDesk;
class SceneDesk;
class SiteTree;
class StationCard;
class TablesDesk;

class MainWindow : public QMainWindow {
  Q_OBJECT

 public:
  explicit MainWindow(QWidget* parent = nullptr);
  ~MainWindow() override;

  // A folder, whether it is a project yet or not; nothing is written.
  void OpenProject(const QString& dir);  // asks first where another's sketch is not saved
  // Writes its trigpoint.yaml, and opens it.
  void CreateProject(const QString& dir);
  // Copies the example into a new folder, and opens it.
  void MakeExample(const QString& dir);
  // The project, desk and selection of the last session, if it ended without Quit or a project was open.
  void RestoreSession();

  Workspace* workspace() const { return workspace_; }
  JobController* jobs() const { return jobs_; }
  Decisions* decisions() const { return decisions_; }
  ProblemBar* problem() const { return problem_; }
  SiteTree* tree() const { return tree_; }
  StationCard* card() const { return card_; }
  OverviewDesk* overview() const { return overview_; }
  RunDesk* run_desk() const { return run_; }
  SceneDesk* scene() const { return scene_; }
  ImagesDesk* images() const { return images_; }
  TablesDesk* tables() const { return tables_; }
  ChartsDesk* charts() const { return charts_; }
  CompareDesk* compare() const { return compare_; }
  ReviewDesk* review() const { return review_; }
  PanoramaDesk* panoramas() const { return panoramas_; }
  CalibrationDesk* calibration() const { return calibration_; }
  PlanDesk* plan() const { return plan_; }
  PrintDesk* print() const { return print_; }
  CheckDesk* check() const { return check_; }
  // "overview", "run", "scene", "images", "tables", "charts", "compare", "review", "panoramas", "calibration",
  // "plan", "print", "check".
  void ShowDesk(const QString& name);
  QString desk() const;
  void SetTheme(const QString& name);  // "system", "dark", "light"
  QStringList RecentProjects() const;

 protected:
  void closeEvent(QCloseEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void dragEnterEvent(QDragEnterEvent* event) override;
  void dropEvent(QDropEvent* event) override;

 private:
  void AddDesks();
  void MakeStatusBar();
  void MakeMenus();
  void ConnectJobs();
  void ConnectOverview();
  QDockWidget* MakeDock(const char* name, const QString& title, QWidget* widget);
  // Calls `go_on` at once, or if the sketch of the plan is not saved when that was asked (plan.ask): Save, Discard.
  void LeaveProject(const std::function<void()>& go_on);
  void ChooseProject();
  void Visit(const QString& dir);  // opens it, on the overview
  void RunAll();
  void ShowReport();
  void ShowRecent();
  void Show(const QString& object);  // on the desk that shows it best
  void SaveSession();
  void ShowMenu(const QString& object, const QPoint& at);
  void MakeEditMenu();
  void MakeRunMenu();
  void MakeViewMenu();
  void MakeHelpMenu();
  void ShowTabs();                        // icons and names, where there is room, else names, else icons
  void ShowAction(const Action& action);  // its form
  void ShowServices();
  void Undo();  // what the desk in front changes
  void Redo();
  bool Sketching() const;  // the plan desk is in front
  bool Marking() const;    // the images desk is
  void ChooseStage(const QString& stage);
  void ShowInScene(const QString& object);
  void ShowIdle();  // in the status bar, while nothing runs
  void AddDesk(QWidget* desk, const char* name, const QString& title);

  Workspace* workspace_;
  JobController* jobs_;
  Decisions* decisions_;
  ProblemBar* problem_;
  SiteTree* tree_;
  StationCard* card_;
  QTabWidget* desks_;
  std::vector<QIcon> icons_;  // of the desks
  QDockWidget *site_, *station_;
  OverviewDesk* overview_;
  RunDesk* run_;
  SceneDesk* scene_;
  ImagesDesk* images_;
  TablesDesk* tables_;
  ChartsDesk* charts_;
  CompareDesk* compare_;
  ReviewDesk* review_;
  PanoramaDesk* panoramas_;
  CalibrationDesk* calibration_;
  PlanDesk* plan_;
  PrintDesk* print_;
  CheckDesk* check_;
  QMenu* recent_ = nullptr;
  QLabel* progress_;
  QPushButton* cancel_;
  QTimer* save_ = nullptr;
  QString theme_ = "system";
  QString select_after_open_;
  bool closing_ = false;
};

}  // namespace trigpoint
