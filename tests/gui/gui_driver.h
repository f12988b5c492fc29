// What the GUI tests share: a window on a project, waiting for what comes by signal, pictures of the desks.
#pragma once

#include <gtest/gtest.h>

#include <QAbstractButton>
#include <QAbstractItemView>
#include <QAction>
#include <QApplication>
#include <QDir>
#include <QFileDialog>
#include <QLineEdit>
#include <QMenu>
#include <QMenuBar>
#include <QMessageBox>
#include <QMouseEvent>
#include <QSettings>
#include <QTableView>
#include <QTemporaryDir>
#include <QTest>
#include <functional>
#include <memory>

#include "app/desktop/main_window.h"
#include "app/desktop/problem_bar.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/tables_desk.h"
#include "tests/support/results_site.h"

namespace trigpoint {

constexpr const char* kDesks[] = {"overview", "run",       "scene",       "images", "tables", "charts", "compare",
                                  "review",   "panoramas", "calibration", "plan",   "print",  "check"};
constexpr int kPatience = 60000;  // ms; machines that are busy with other things are slow

// One comparison of four answers.
constexpr const char* kEvaluateSummary = R"({"schema": "trigpoint evaluate 1", "confidence": 0.95, "groups": [
  {"variant": "", "method": "single", "reference": "control", "kind": "absolute", "shares_evidence": false,
   "answers": 4, "attempts": 4, "error_3d": {"over_answers": {"median_m": 0.025, "p90_m": 0.037, "max_m": 0.04}},
   "cumulative": [{"error_m": 0.01, "share": 0.25}, {"error_m": 0.02, "share": 0.5},
                  {"error_m": 0.03, "share": 0.75}, {"error_m": 0.04, "share": 1.0}]}]})";

inline bool WaitFor(const std::function<bool()>& condition, int ms = kPatience) {
  return QTest::qWaitFor(condition, ms);
}

template <typename Widget>
Widget* Child(QWidget* parent, const char* name) {
  Widget* widget = parent->findChild<Widget*>(name);
  EXPECT_NE(widget, nullptr) << name;
  return widget;
}

inline void Click(QWidget* parent, const char* button) {
  QTest::mouseClick(Child<QAbstractButton>(parent, button), Qt::LeftButton);
}

// On a machine on which that takes long one is asked whether it is to be run: yes.
inline void ClickToRun(QWidget* window, const char* button) {
  Click(window, button);
  if (auto* ask = window->findChild<QMessageBox*>("run.ask")) ask->button(QMessageBox::Yes)->click();
}

inline void Type(QWidget* parent, const char* edit, const QString& text) {
  QLineEdit* line = Child<QLineEdit>(parent, edit);
  line->selectAll();
  QTest::keyClicks(line, text);
}

// A row whose cells hold a text; -1: none.
inline int RowWith(const QAbstractItemView* view, const QString& text) {
  for (int row = 0; row < view->model()->rowCount(); ++row) {
    for (int column = 0; column < view->model()->columnCount(); ++column) {
      if (view->model()->index(row, column).data().toString() == text) return row;
    }
  }
  return -1;
}

// Chooses a file or folder in the dialog that a form's button opened.
inline void ChoosePath(QWidget* window, const QString& path) {
  auto* dialog = Child<QFileDialog>(window, "path.dialog");
  ASSERT_NE(dialog, nullptr);
  Child<QLineEdit>(dialog, "fileNameEdit")->setText(path);
  ASSERT_TRUE(QMetaObject::invokeMethod(dialog, "accept"));
  ASSERT_TRUE(WaitFor([&] { return window->findChild<QFileDialog*>("path.dialog") == nullptr; }));
}

// QTest moves the mouse without its button.
inline void Drag(QWidget* view, const QPoint& from, const QPoint& to) {
  QTest::mousePress(view, Qt::LeftButton, {}, from);
  for (const QPoint& at : {(from + to) / 2, to}) {
    QMouseEvent move(QEvent::MouseMove, at, Qt::LeftButton, Qt::LeftButton, {});
    QApplication::sendEvent(view, &move);
  }
  QTest::mouseRelease(view, Qt::LeftButton, {}, to);
}

inline void ClickRow(QAbstractItemView* view, int row) {
  const QModelIndex index = view->model()->index(row, 0);
  view->scrollTo(index);
  QTest::mouseClick(view->viewport(), Qt::LeftButton, {}, view->visualRect(index).center());
}

// A picture of the window, where TRIGPOINT_SCREENSHOTS names a folder for it.
inline void Screenshot(QWidget* window, const QString& name) {
  const QString folder = qEnvironmentVariable("TRIGPOINT_SCREENSHOTS");
  if (folder.isEmpty()) return;
  QDir().mkpath(folder);
  QTest::qWait(300);
  EXPECT_TRUE(window->grab().save(folder + "/" + name + ".png"));
}

inline std::unique_ptr<MainWindow> OpenWindow(const QString& dir) {
  auto window = std::make_unique<MainWindow>();
  window->resize(1280, 800);
  window->show();
  EXPECT_TRUE(QTest::qWaitForWindowExposed(window.get()));
  QApplication::setActiveWindow(window.get());  // without a window manager nobody else does
  if (!dir.isEmpty()) {
    window->OpenProject(dir);
    EXPECT_TRUE(WaitFor([&] { return window->workspace()->snapshot() != nullptr; }));
  }
  return window;
}

// A window on a small project whose results are in place, made once for all tests of a suite.
class ResultsWindowTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    site_ = new QTemporaryDir;
    WriteResultsSite(site_->path().toStdString(), {});
  }
  static void TearDownTestSuite() { delete site_; }
  void SetUp() override {
    QSettings().clear();
    window_ = OpenWindow(site_->path());
  }
  QString Path(const char* file) const { return site_->path() + "/" + file; }
  QAction* MenuAction(const QString& text) {
    for (QAction* menu : window_->menuBar()->actions()) {
      for (QAction* action : menu->menu()->actions()) {
        if (action->text().remove('&') == text) return action;
      }
    }
    ADD_FAILURE() << text.toStdString();
    return nullptr;
  }
  void ShowScene() {
    window_->ShowDesk("scene");
    ASSERT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
  }
  void ShowErrors() {
    window_->ShowDesk("tables");
    ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/errors"); }));
    view_ = Child<QTableView>(window_.get(), "tables.view");
    ASSERT_TRUE(WaitFor([&] { return RowWith(view_, "S2") >= 0; }));
  }

  static inline QTemporaryDir* site_ = nullptr;
  std::unique_ptr<MainWindow> window_;
  QTableView* view_ = nullptr;
};

}  // namespace trigpoint
