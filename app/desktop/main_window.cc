#include "app/desktop/main_window.h"

#include <QActionGroup>
#include <QApplication>
#include <QCloseEvent>
#include <QComboBox>
#include <QDesktopServices>
#include <QDockWidget>
#include <QDragEnterEvent>
#include <QFileDialog>
#include <QLabel>
#include <QMenuBar>
#include <QMessageBox>
#include <QMimeData>
#include <QPushButton>
#include <QSettings>
#include <QStatusBar>
#include <QStyleFactory>
#include <QTabBar>
#include <QTabWidget>
#include <QTimer>
#include <QUrl>
#include <utility>

#include "app/desktop/action_dialog.h"
#include "app/desktop/background.h"
#include "app/desktop/calibration_desk.h"
#include "app/desktop/charts_desk.h"
#include "app/desktop/check_desk.h"
#include "app/desktop/compare_desk.h"
#include "app/desktop/decisions.h"
#include "app/desktop/help_dialog.h"
#include "app/desktop/icons.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/panorama_desk.h"
#include "app/desktop/plan_desk.h"
#include "app/desktop/print_desk.h"
#include "app/desktop/problem_bar.h"
#include "app/desktop/question.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/services_dialog.h"
#include "app/desktop/site_tree.h"
#include "app/desktop/station_card.h"
#include "app/desktop/tables_desk.h"
#include "app/desktop/widgets.h"
#include "datasets/project/demo_site.h"
#include "datasets/project/project.h"

namespace trigpoint {

namespace {

constexpr int kMostRecent = 10;
constexpr int kDocks = 344, kWideDocks = 420;  // pixels: width of the docks at the left

QPalette DarkPalette() {
  QPalette dark;
  const QColor base(35, 38, 41), window(49, 54, 59), text(239, 240, 241), accent(61, 174, 233);
  dark.setColor(QPalette::Window, window);
  dark.setColor(QPalette::WindowText, text);
  dark.setColor(QPalette::Base, base);
  dark.setColor(QPalette::AlternateBase, QColor(42, 46, 50));
  dark.setColor(QPalette::ToolTipBase, window);
  dark.setColor(QPalette::ToolTipText, text);
  dark.setColor(QPalette::Text, text);
  dark.setColor(QPalette::Button, window);
  dark.setColor(QPalette::ButtonText, text);
  dark.setColor(QPalette::BrightText, Qt::white);
  dark.setColor(QPalette::Dark, QColor(25, 27, 29));
  dark.setColor(QPalette::Link, accent);
  dark.setColor(QPalette::Highlight, accent);
  dark.setColor(QPalette::HighlightedText, Qt::black);
  dark.setColor(QPalette::PlaceholderText, QColor(160, 160, 160));
  for (const auto role : {QPalette::WindowText, QPalette::Text, QPalette::ButtonText}) {
    dark.setColor(QPalette::Disabled, role, QColor(130, 130, 130));
  }
  return dark;
}

}  // namespace

MainWindow::MainWindow(QWidget* parent) : QMainWindow(parent) {
  setObjectName("trigpoint");
  setAcceptDrops(true);
  setWindowTitle(tr("Trigpoint"));
  resize(1280, 800);
  workspace_ = new Workspace(this);
  jobs_ = new JobController(this);
  decisions_ = new Decisions(workspace_, this);
  problem_ = new ProblemBar;
  tree_ = new SiteTree(workspace_);
  card_ = new StationCard(workspace_);
  desks_ = Named(new QTabWidget, "desks", tr("Desks"));
  desks_->setDocumentMode(true);
  overview_ = new OverviewDesk(workspace_);
  run_ = new RunDesk(workspace_, jobs_);
  scene_ = new SceneDesk(workspace_);
  images_ = new ImagesDesk(workspace_);
  tables_ = new TablesDesk(workspace_);
  charts_ = new ChartsDesk(workspace_);
  compare_ = new CompareDesk(workspace_);
  review_ = new ReviewDesk(workspace_, jobs_, decisions_);
  panoramas_ = new PanoramaDesk(workspace_);
  calibration_ = new CalibrationDesk(workspace_);
  plan_ = new PlanDesk(workspace_, jobs_);
  print_ = new PrintDesk(workspace_);
  check_ = new CheckDesk(workspace_);
  AddDesks();
  setCentralWidget(desks_);
  site_ = MakeDock("site", tr("Site"), tree_);
  station_ = MakeDock("station", tr("Station"), card_);
  resizeDocks({site_, station_}, {330, 330}, Qt::Vertical);
  MakeStatusBar();
  connect(desks_, &QTabWidget::currentChanged, this, &MainWindow::ShowTabs);
  MakeMenus();

  save_ = new QTimer(this);  // what was done last survives a crash
  save_->setSingleShot(true);
  save_->setInterval(300);
  connect(save_, &QTimer::timeout, this, &MainWindow::SaveSession);
  const auto save_soon = [this] { save_->start(); };
  connect(desks_, &QTabWidget::currentChanged, this, save_soon);
  connect(workspace_, &Workspace::Selected, this, save_soon);
  connect(workspace_, &Workspace::UnitChanged, this, save_soon);

  connect(workspace_, &Workspace::Opened, this, [this, save_soon] {
    setWindowTitle(tr("%1 - Trigpoint").arg(Text(workspace_->snapshot()->name)));
    setWindowFilePath(workspace_->dir());
    QSettings settings;
    QStringList recent = settings.value("recent").toStringList();
    recent.removeAll(workspace_->dir());
    recent.prepend(workspace_->dir());
    settings.setValue("recent", QStringList(recent.mid(0, kMostRecent)));
    ShowRecent();
    ShowIdle();
    if (!select_after_open_.isEmpty()) workspace_->Select(std::exchange(select_after_open_, QString()));
    save_soon();
  });
  connect(workspace_, &Workspace::Closed, this, [this, save_soon] {
    setWindowTitle(tr("Trigpoint"));
    setWindowFilePath("");
    problem_->hide();
    ShowIdle();
    save_soon();
  });
  connect(workspace_, &Workspace::Problem, problem_, &ProblemBar::Show);
  connect(workspace_, &Workspace::Problem, this, [this] {
    if (!workspace_->opening()) ShowIdle();
  });
  ConnectJobs();
  connect(tree_, &SiteTree::Activated, this, &MainWindow::Show);
  connect(tree_, &SiteTree::RunRequested, this,
          [this](const QString& stage, const QString& run, const QString& variant) {
            run_->Choose(stage, run, variant);
            ShowDesk("run");
          });
  connect(review_, &ReviewDesk::Reviewed, problem_, &QWidget::hide);
  connect(tables_, &TablesDesk::Activated, this, &MainWindow::Show);
  connect(scene_, &SceneDesk::Activated, this, &MainWindow::Show);
  connect(charts_, &ChartsDesk::Activated, this, &MainWindow::Show);
  connect(compare_, &CompareDesk::Activated, this, &MainWindow::Show);
  ConnectOverview();
  connect(calibration_, &CalibrationDesk::CalibrateRequested, this, [this] { ChooseStage("calibrate"); });
  connect(plan_, &PlanDesk::OptionsRequested, this, [this] { ChooseStage("plan"); });
  connect(panoramas_, &PanoramaDesk::StitchRequested, this, [this] { ChooseStage("stitch"); });
  QSettings settings;
  restoreGeometry(settings.value("geometry").toByteArray());
  SetTheme(settings.value("theme", "system").toString());
  const QString unit = settings.value("unit").toString();
  if (unit == "ft" || unit == "us-ft") workspace_->SetUnit(unit);
  ShowRecent();
  ShowIdle();
}

void MainWindow::AddDesks() {
  AddDesk(overview_, "overview", tr("Overview"));
  AddDesk(run_, "run", tr("Run"));
  AddDesk(scene_, "scene", tr("3D"));
  AddDesk(images_, "images", tr("Images"));
  AddDesk(tables_, "tables", tr("Tables"));
  AddDesk(charts_, "charts", tr("Charts"));
  AddDesk(compare_, "compare", tr("Compare"));
  AddDesk(review_, "review", tr("Review"));
  AddDesk(panoramas_, "panoramas", tr("Panoramas"));
  AddDesk(calibration_, "calibration", tr("Calibration"));
  AddDesk(plan_, "plan", tr("Plan"));
  AddDesk(print_, "print", tr("Print"));
  AddDesk(check_, "check", tr("Check"));
}

void MainWindow::MakeStatusBar() {
  progress_ = Named(new QLabel, "progress");
  progress_->setMinimumWidth(20 * fontMetrics().averageCharWidth());
  progress_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);  // a long path makes no window wide
  cancel_ = MakeButton("cancel", tr("Cancel"));
  cancel_->hide();
  statusBar()->addWidget(progress_, 1);
  statusBar()->addWidget(scene_->place(), 3);
  scene_->place()->hide();
  statusBar()->addWidget(problem_, 2);
  // As high as with a problem, so that none moves what is above.
  statusBar()->setMinimumHeight(std::max(problem_->sizeHint().height(), cancel_->sizeHint().height()) + 4);
  statusBar()->addPermanentWidget(cancel_);
}

QDockWidget* MainWindow::MakeDock(const char* name, const QString& title, QWidget* widget) {
  auto* dock = Named(new QDockWidget(title), name);
  dock->setWidget(widget);
  dock->setFeatures(QDockWidget::DockWidgetMovable | QDockWidget::DockWidgetClosable);
  addDockWidget(Qt::LeftDockWidgetArea, dock);
  return dock;
}

MainWindow::~MainWindow() {
  // Views that go say so, and nobody may listen any more.
  disconnect(desks_, nullptr, this, nullptr);
  workspace_->disconnect();
  jobs_->disconnect();
  delete tree_;
  delete takeCentralWidget();
}

void MainWindow::ConnectJobs() {
  connect(jobs_, &JobController::Started, this, [this] { cancel_->show(); });
  connect(jobs_, &JobController::JobBegan, workspace_, [this](const QString& job) {
    if (jobs_->dir() == workspace_->dir()) workspace_->SetState(job, "running");
  });
  connect(jobs_, &JobController::JobEnded, workspace_,
          [this](const QString& job, const QString& end, const QString& why) {
            if (end != "skipped" && jobs_->dir() == workspace_->dir())
              workspace_->SetState(job, end == "computed" || end == "up to date" ? QString("done") : end, why);
          });
  connect(workspace_, &Workspace::StateChanged, tree_, [this](int index) {
    const SnapshotResult& result = workspace_->results()[static_cast<size_t>(index)];
    tree_->SetState(Text(result.title), Text(result.state));
  });
  connect(
      jobs_, &JobController::Progress, this,
      [this](const QString& job, const QString& task, qint64 done, qint64 total) {
        const QString of = jobs_->OtherProject(workspace_->dir());
        const QString name = of.isEmpty() ? job : of + ": " + job;
        progress_->setText(total > 0 ? tr("%1: %2, %3 %").arg(name, task).arg(100 * done / total) : name + ": " + task);
      });
  connect(jobs_, &JobController::Finished, this, [this](JobController::End end) {
    cancel_->hide();
    const QString of = jobs_->OtherProject(workspace_->dir());
    progress_->setText((of.isEmpty() ? "" : of + ": ") + (end == JobController::End::kDone ? tr("Done.")
                                                          : end == JobController::End::kFailed
                                                              ? tr("Failed.")
                                                              : tr("Cancelled; finished stages are kept.")));
    if (closing_) {
      close();
    } else {
      workspace_->Reload();
    }
  });
  connect(cancel_, &QPushButton::clicked, jobs_, &JobController::Cancel);
}

void MainWindow::ConnectOverview() {
  connect(overview_, &OverviewDesk::Loaded, card_, [this] { card_->SetOverview(overview_->overview()); });
  auto* variant = scene_->findChild<QComboBox*>("scene.variant");
  const auto follow = [this, variant] {
    card_->SetVariant(desk() == "scene" ? variant->currentData().toString() : QString());
  };
  connect(variant, QOverload<int>::of(&QComboBox::currentIndexChanged), card_, follow);
  connect(desks_, &QTabWidget::currentChanged, card_, follow);
  connect(card_, &StationCard::ImageRequested, this, &MainWindow::Show);
  connect(card_, &StationCard::SceneRequested, this, &MainWindow::ShowInScene);
  connect(overview_, &OverviewDesk::SceneRequested, this, &MainWindow::ShowInScene);
  connect(overview_, &OverviewDesk::LookRequested, scene_, &SceneDesk::LookAt);
  connect(overview_, &OverviewDesk::RunRequested, this, &MainWindow::RunAll);
  connect(overview_, &OverviewDesk::ReportRequested, this, &MainWindow::ShowReport);
  connect(overview_, &OverviewDesk::CreateRequested, this, &MainWindow::CreateProject);
  connect(overview_, &OverviewDesk::ProjectRequested, this, &MainWindow::Visit);
  connect(overview_, &OverviewDesk::OpenRequested, this, &MainWindow::ChooseProject);
  connect(overview_, &OverviewDesk::ExampleRequested, this, [this] {
    const QString below = QFileDialog::getExistingDirectory(this, tr("Where the folder trigpoint-demo is made"));
    if (!below.isEmpty()) MakeExample(below + "/trigpoint-demo");
  });
}

void MainWindow::ChooseProject() {
  const QString dir = QFileDialog::getExistingDirectory(this, tr("Open a project's folder"));
  if (!dir.isEmpty()) Visit(dir);
}

void MainWindow::Visit(const QString& dir) {
  ShowDesk("overview");
  OpenProject(dir);
}

void MainWindow::RunAll() {
  run_->Choose("", "", "");
  ShowDesk("run");
  run_->Run();
}

void MainWindow::ShowReport() {
  const QString file = workspace_->dir() + "/results/report/index.html";
  if (!QFileInfo::exists(file)) {
    emit workspace_->Problem(tr("There is no report yet: run the stage report."), file);
    return;
  }
  if (!QDesktopServices::openUrl(QUrl::fromLocalFile(file))) {
    emit workspace_->Problem(tr("No program opens the report: %1").arg(file), "");
  }
}

void MainWindow::AddDesk(QWidget* desk, const char* name, const QString& title) {
  desk->setObjectName(QString("desk.") + name);
  icons_.push_back(IconNamed(name));
  const int tab = desks_->addTab(desk, icons_.back(), title);
  desks_->setTabToolTip(tab, title);
}

void MainWindow::ShowTabs() {
  const auto show = [this](bool names, bool icons) {
    for (int i = 0; i < desks_->count(); ++i) {
      const bool named = names || i == desks_->currentIndex();
      desks_->setTabText(i, named ? desks_->tabToolTip(i) : QString());
      desks_->setTabIcon(i, icons ? icons_.at(static_cast<size_t>(i)) : QIcon());
    }
    return desks_->tabBar()->sizeHint().width() <= desks_->width();
  };
  if (!show(true, true) && !show(true, false)) show(false, true);
}

void MainWindow::resizeEvent(QResizeEvent* event) {
  QMainWindow::resizeEvent(event);
  const bool first = !event->oldSize().isValid();
  const auto arrange = [this, first] {  // the tabs have their new width then
    // All columns of a station's card where there is room.
    if (first) resizeDocks({site_}, {std::clamp(width() * 27 / 100, kDocks, kWideDocks)}, Qt::Horizontal);
    ShowTabs();
  };
  QMetaObject::invokeMethod(this, arrange, Qt::QueuedConnection);
}

void MainWindow::MakeMenus() {
  QMenu* file = menuBar()->addMenu(tr("&File"));
  file->addAction(IconNamed("open"), tr("&Open project or folder ..."), this, &MainWindow::ChooseProject,
                  QKeySequence::Open);
  recent_ = file->addMenu(tr("&Recent projects"));
  connect(recent_, &QMenu::aboutToShow, this, &MainWindow::ShowRecent);  // one may be gone by now
  file->addAction(IconNamed("reload"), tr("Re&load"), workspace_, &Workspace::Reload, QKeySequence::Refresh);
  file->addAction(
      tr("&Close project"), this, [this] { LeaveProject([this] { workspace_->Close(); }); }, QKeySequence::Close);
  file->addSeparator();
  file->addAction(
      IconNamed("export"), tr("&Export ..."), this, [this] { ShowAction(ExportAction()); }, QKeySequence(tr("Ctrl+E")));
  file->addAction(
      tr("&Import ..."), this, [this] { ShowAction(ImportAction()); }, QKeySequence(tr("Ctrl+I")));
  file->addAction(tr("&Panoramas of services ..."), this, &MainWindow::ShowServices);
  file->addAction(IconNamed("publish"), tr("Pu&blish ..."), this, [this] { ShowAction(PublishAction()); });
  file->addSeparator();
  file->addAction(IconNamed("report"), tr("Open the &report"), this, &MainWindow::ShowReport,
                  QKeySequence(tr("Ctrl+Shift+O")));
  file->addSeparator();
  file->addAction(tr("&Quit"), this, &QWidget::close, QKeySequence::Quit);

  MakeEditMenu();
  MakeRunMenu();
  MakeViewMenu();
  MakeHelpMenu();
}

void MainWindow::MakeHelpMenu() {
  QMenu* help = menuBar()->addMenu(tr("&Help"));
  help->addAction(
      IconNamed("help"), tr("&Keys and terms"), this, [this] { (new HelpDialog(menuBar(), this))->show(); },
      QKeySequence::HelpContents);
  help->addAction(tr("&About"), this, [this] {
    QMessageBox::about(
        this, tr("Trigpoint"),
        tr("Trigpoint %1: ground truth for visual localization.").arg(QApplication::applicationVersion()));
  });
}

void MainWindow::MakeRunMenu() {
  QMenu* run = menuBar()->addMenu(tr("&Run"));
  run->addAction(IconNamed("run"), tr("Run all that is &out of date"), this, &MainWindow::RunAll,
                 QKeySequence(tr("Ctrl+R")));
  QAction* cancel =
      run->addAction(IconNamed("cancel"), tr("&Cancel"), jobs_, &JobController::Cancel, QKeySequence(tr("Ctrl+.")));
  const auto enable = [this, cancel] { cancel->setEnabled(jobs_->running()); };
  enable();
  connect(jobs_, &JobController::Started, cancel, enable);
  connect(jobs_, &JobController::Finished, cancel, enable);
  run->addAction(
      tr("Re-&solve after a review"), this,
      [this] {
        ShowDesk("review");
        review_->Solve();
      },
      QKeySequence(tr("Ctrl+Shift+R")));
  run->addSeparator();
  run->addAction(IconNamed("report"), tr("Make the r&eport ..."), this, [this] { ChooseStage("report"); });
  run->addAction(IconNamed("compare"), tr("Cross-check with COL&MAP ..."), this, [this] { ChooseStage("crosscheck"); });
  run->addSeparator();
  run->addAction(IconNamed("plan"), tr("&Plan a survey ..."), this, [this] { ShowDesk("plan"); });
  run->addAction(IconNamed("print"), tr("Print &tags and boards ..."), this, [this] { ShowDesk("print"); });
  run->addAction(IconNamed("check"), tr("Chec&k what was recorded so far"), this, [this] { ShowDesk("check"); });
}

void MainWindow::ChooseStage(const QString& stage) {
  run_->Choose(stage, "");
  ShowDesk("run");
}

void MainWindow::ShowServices() {
  if (!workspace_->snapshot()) {
    emit workspace_->Problem(tr("Open a project first."), "");
    return;
  }
  (new ServicesDialog(workspace_, this))->show();
}

void MainWindow::ShowAction(const Action& action) {
  if (!workspace_->snapshot()) {
    emit workspace_->Problem(tr("Open a project first."), "");
    return;
  }
  (new ActionDialog(workspace_, action, this))->show();
}

void MainWindow::MakeViewMenu() {
  QMenu* view = menuBar()->addMenu(tr("&View"));
  for (int i = 0; i < desks_->count(); ++i) {
    view->addAction(
        icons_.at(static_cast<size_t>(i)), desks_->tabToolTip(i), this, [this, i] { desks_->setCurrentIndex(i); },
        QKeySequence((i < 10 ? tr("Ctrl+%1") : tr("Ctrl+Alt+%1")).arg((i + 1) % 10)));
  }
  view->addSeparator();
  view->addAction(site_->toggleViewAction());
  view->addAction(station_->toggleViewAction());
  view->addSeparator();
  const auto choices = [this, view](const QString& title, const QStringList& names, const QStringList& texts,
                                    const char* key, const QString& standard, auto set) {
    QMenu* menu = view->addMenu(title);
    auto* group = new QActionGroup(menu);
    const QString now = QSettings().value(key, standard).toString();
    for (int i = 0; i < names.size(); ++i) {
      QAction* action = menu->addAction(texts[i], this, [set, name = names[i]] { set(name); });
      action->setCheckable(true);
      action->setChecked(names[i] == now);
      group->addAction(action);
    }
  };
  choices(tr("&Units"), {"m", "ft", "us-ft"}, {tr("metres"), tr("feet"), tr("US survey feet")}, "unit", "m",
          [this](const QString& name) { workspace_->SetUnit(name); });
  choices(tr("&Theme"), {"system", "light", "dark"}, {tr("as the system"), tr("light"), tr("dark")}, "theme", "system",
          [this](const QString& name) { SetTheme(name); });
}

void MainWindow::MakeEditMenu() {
  QMenu* edit = menuBar()->addMenu(tr("&Edit"));
  // A field of text in which one writes keeps these keys for its own text.
  QAction* undo = edit->addAction(IconNamed("undo"), tr("&Undo"), this, &MainWindow::Undo, QKeySequence::Undo);
  QAction* redo = edit->addAction(IconNamed("redo"), tr("&Redo"), this, &MainWindow::Redo);
  redo->setShortcuts({QKeySequence(tr("Ctrl+Shift+Z")), QKeySequence(tr("Ctrl+Y"))});
  undo->setObjectName("edit.undo");
  redo->setObjectName("edit.redo");
  // What the desk in front changes: on the plan its sketch, on the images marks, elsewhere decisions.
  const auto show = [this, undo, redo] {
    QString back, again;
    if (Sketching()) {
      back = plan_->UndoText(), again = plan_->RedoText();
    } else if (Marking()) {
      back = images_->UndoText(), again = images_->RedoText();
    } else {
      back = decisions_->UndoText(), again = decisions_->RedoText();
    }
    undo->setText(back.isEmpty() ? tr("&Undo") : tr("&Undo: %1").arg(back));
    redo->setText(again.isEmpty() ? tr("&Redo") : tr("&Redo: %1").arg(again));
    undo->setEnabled(!back.isEmpty());
    redo->setEnabled(!again.isEmpty());
  };
  connect(decisions_, &Decisions::Changed, edit, show);
  connect(plan_, &PlanDesk::Changed, edit, show);
  connect(images_, &ImagesDesk::MarksChanged, edit, show);
  connect(desks_, &QTabWidget::currentChanged, edit, show);
  show();
  connect(workspace_, &Workspace::MenuAsked, this, &MainWindow::ShowMenu);
}

void MainWindow::Undo() {
  if (Sketching()) return plan_->Undo();
  if (Marking()) return images_->Undo();
  decisions_->Undo();
}

void MainWindow::Redo() {
  if (Sketching()) return plan_->Redo();
  if (Marking()) return images_->Redo();
  decisions_->Redo();
}

bool MainWindow::Sketching() const { return desk() == "plan"; }
bool MainWindow::Marking() const { return desk() == "images"; }

void MainWindow::ShowInScene(const QString& object) {
  workspace_->Select(object);
  ShowDesk("scene");
  scene_->LookAt(object);
}

void MainWindow::ShowMenu(const QString& object, const QPoint& at) {
  auto* menu = new QMenu(this);
  menu->setObjectName("object.menu");
  menu->setAttribute(Qt::WA_DeleteOnClose);
  menu->addSection(object);
  menu->addAction(tr("Show its &image"), this, [this, object] { Show(object); });
  menu->addAction(tr("Show in &3D"), this, [this, object] { ShowInScene(object); });
  menu->addSeparator();
  decisions_->AddTo(menu, object);
  menu->popup(at);
}

void MainWindow::OpenProject(const QString& dir) {
  const auto open = [this, dir] {
    problem_->hide();
    progress_->setText(tr("Opening %1 ...").arg(dir));
    workspace_->Open(dir);
  };
  // The same project again keeps its sketch.
  if (workspace_->snapshot() && QFileInfo(dir) == QFileInfo(workspace_->dir())) return open();
  LeaveProject(open);
}

void MainWindow::LeaveProject(const std::function<void()>& go_on) {
  if (!plan_->sketch().changed()) return go_on();
  Ask(this, "plan.ask", tr("Plan"), tr("The sketch of the plan is not saved."),
      QMessageBox::Save | QMessageBox::Discard | QMessageBox::Cancel, [this, go_on](int answer) {
        if (answer == QMessageBox::Discard) plan_->Discard();
        if (answer == QMessageBox::Discard || (answer == QMessageBox::Save && plan_->Save())) go_on();
      });
}

void MainWindow::CreateProject(const QString& dir) {
  problem_->hide();
  InBackground(
      this, [path = dir.toStdString()] { return Project::Init(path).missing; },
      [this, dir](const Attempted<std::vector<std::string>>& made) {
        if (!made.error.isEmpty()) {
          emit workspace_->Problem(made.error, tr("No project was made."));
          return;
        }
        OpenProject(dir);
      });
}

void MainWindow::MakeExample(const QString& dir) {
  progress_->setText(tr("Copying the example ..."));
  InBackground(
      this,
      [path = dir.toStdString()] {
        MakeDemoSite(path);
        return true;
      },
      [this, dir](const Attempted<bool>& made) {
        if (made.error.isEmpty()) return Visit(dir);
        emit workspace_->Problem(made.error, tr("The example was not made."));
      });
}

void MainWindow::RestoreSession() {
  const QSettings settings;
  ShowDesk(settings.value("session/desk", "overview").toString());
  const QString dir = settings.value("session/project").toString();
  if (dir.isEmpty()) return;
  select_after_open_ = settings.value("session/selected").toString();
  OpenProject(dir);
}

void MainWindow::SaveSession() {
  QSettings settings;
  settings.setValue("session/project", workspace_->dir());
  settings.setValue("session/desk", desk());
  settings.setValue("session/selected", workspace_->selected());
  settings.setValue("geometry", saveGeometry());
  settings.setValue("unit", workspace_->unit());
  settings.setValue("theme", theme_);
  settings.sync();
}

void MainWindow::ShowIdle() {
  if (jobs_->running()) return;
  progress_->setText(workspace_->snapshot() ? workspace_->dir()
                                            : tr("Drop a project folder here, or open one (Ctrl+O)."));
  progress_->setToolTip(workspace_->dir());
}

QStringList MainWindow::RecentProjects() const {
  QStringList there;
  for (const QString& dir : QSettings().value("recent").toStringList()) {
    if (QFileInfo::exists(dir)) there << dir;
  }
  return there;
}

void MainWindow::ShowRecent() {
  recent_->clear();
  for (const QString& dir : RecentProjects()) recent_->addAction(dir, this, [this, dir] { Visit(dir); });
  if (!recent_->isVisible()) recent_->setEnabled(!recent_->isEmpty());
}

void MainWindow::ShowDesk(const QString& name) {
  for (int i = 0; i < desks_->count(); ++i) {
    if (desks_->widget(i)->objectName() == "desk." + name) desks_->setCurrentIndex(i);
  }
}

QString MainWindow::desk() const { return desks_->currentWidget()->objectName().section('.', 1); }

void MainWindow::Show(const QString& object) {
  workspace_->Select(object);
  if (images_->ShowObject(object)) {
    ShowDesk("images");
  } else {
    ShowDesk("scene");
  }
}

void MainWindow::SetTheme(const QString& name) {
  theme_ = name;
  static const QString kSystemStyle = QApplication::style()->objectName();
  if (name == "system") {
    QApplication::setStyle(QStyleFactory::create(kSystemStyle));
    QApplication::setPalette(QApplication::style()->standardPalette());
  } else {
    QApplication::setStyle(QStyleFactory::create("Fusion"));
    QApplication::setPalette(name == "dark" ? DarkPalette() : QApplication::style()->standardPalette());
  }
  save_->start();
}

void MainWindow::closeEvent(QCloseEvent* event) {
  if (plan_->sketch().changed()) {
    event->ignore();
    // Asked at the end of a run that was to close the window: that run is read like any other, and the answer decides.
    if (std::exchange(closing_, false)) workspace_->Reload();
    return LeaveProject([this] { close(); });
  }
  if (jobs_->running()) {  // the worker ends at its next breath; finished stages are kept
    closing_ = true;
    jobs_->Cancel();
    progress_->setText(tr("Stopping the run ..."));
    event->ignore();
    return;
  }
  SaveSession();
  event->accept();
}

void MainWindow::dragEnterEvent(QDragEnterEvent* event) {
  for (const QUrl& url : event->mimeData()->urls()) {
    if (url.isLocalFile() && QFileInfo(url.toLocalFile()).exists()) event->acceptProposedAction();
  }
}

void MainWindow::dropEvent(QDropEvent* event) {
  for (const QUrl& url : event->mimeData()->urls()) {
    const QFileInfo info(url.toLocalFile());
    event->acceptProposedAction();
    Visit(info.isDir() ? info.absoluteFilePath() : info.absolutePath());
    return;
  }
}

}  // namespace trigpoint
