// What used to stay, move or be cut: other projects' pictures, the bar with problems, narrow windows, folded trees.
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QDockWidget>
#include <QLabel>
#include <QMenuBar>
#include <QSignalSpy>
#include <QTableWidget>
#include <QThread>

#include "app/desktop/compare_desk.h"
#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/number_item.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/site_tree.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class MendedTest : public ResultsWindowTest {};

TEST_F(MendedTest, AnotherProjectLeavesNothingOfTheFirst) {
  ShowErrors();
  ShowScene();
  ASSERT_TRUE(WaitFor([&] { return window_->scene()->PlaceOf("panorama:panoramas/p001.jpg").x() > 0; }));
  window_->ShowDesk("images");
  ASSERT_TRUE(window_->images()->ShowObject("image:run1/images/000004.jpg"));
  ASSERT_TRUE(WaitFor([&] { return !window_->images()->left()->image().isNull(); }));
  ASSERT_TRUE(WaitFor([&] { return !window_->images()->right()->image().isNull(); }));
  Child<QComboBox>(window_.get(), "images.point")->setCurrentText("P1");
  window_->ShowDesk("run");
  window_->run_desk()->Choose("detect", "");
  Type(window_.get(), "option.min_margin", "40.5");

  // The same inputs without results: every name is there again, and nothing may be taken from the first.
  const QTemporaryDir second;
  WriteResultsSite(second.path().toStdString(), {});
  QDir(second.path() + "/results").removeRecursively();
  bool replaced = false;
  const auto watching = QObject::connect(window_->workspace(), &Workspace::Opened, window_.get(), [&] {
    replaced = true;
    EXPECT_FALSE(window_->scene()->HasScene());
    EXPECT_TRUE(window_->images()->left()->image().isNull());
    EXPECT_TRUE(window_->images()->right()->image().isNull());
  });
  window_->OpenProject(second.path());
  ASSERT_TRUE(WaitFor([&] { return replaced; }));
  QObject::disconnect(watching);
  EXPECT_EQ(Child<QComboBox>(window_.get(), "images.point")->currentText(), "");
  EXPECT_EQ(view_->model()->rowCount(), 0);
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "run.command")->text(), "trigpoint detect " + second.path());
  window_->ShowDesk("scene");
  EXPECT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
  EXPECT_LT(window_->scene()->PlaceOf("panorama:panoramas/p001.jpg").x(), 0);
  window_->workspace()->Close();
  EXPECT_FALSE(window_->scene()->HasScene());
  EXPECT_TRUE(window_->images()->left()->image().isNull());
  EXPECT_EQ(window_->windowTitle(), "Trigpoint");
}

TEST_F(MendedTest, WhatIsTypedOutlastsAReload) {
  window_->ShowDesk("run");
  window_->run_desk()->Choose("detect", "");
  Type(window_.get(), "option.min_margin", "40.5");
  Child<QComboBox>(window_.get(), "images.point")->setCurrentText("P1");
  const auto before = window_->workspace()->snapshot();
  window_->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->snapshot() != before; }));
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "option.min_margin")->text(), "40.5");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("--set min_margin=40.5"));
  EXPECT_EQ(Child<QComboBox>(window_.get(), "images.point")->currentText(), "P1");
}

TEST_F(MendedTest, EveryDeskFitsIntoASmallWindow) {
  for (const char* desk : kDesks) {
    window_->ShowDesk(desk);
    QTest::qWait(50);
    window_->resize(1024, 700);
    QTest::qWait(50);
    EXPECT_LE(window_->width(), 1024) << desk;
    EXPECT_LE(window_->height(), 700) << desk;
    Screenshot(window_.get(), QString("small_") + desk);
  }
}

TEST_F(MendedTest, AProblemMovesNothing) {
  window_->ShowDesk("run");
  const auto* run = Child<QWidget>(window_.get(), "run.run");
  const QPoint before = run->mapTo(window_.get(), QPoint(0, 0));
  const QString sentence = "A sentence about a file that is longer than any window is wide: " + QString(300, 'x');
  emit window_->workspace()->Problem(sentence, "what stands behind it");
  ASSERT_TRUE(WaitFor([&] { return window_->problem()->isVisible(); }));
  QTest::qWait(50);
  EXPECT_EQ(run->mapTo(window_.get(), QPoint(0, 0)), before);
  EXPECT_EQ(window_->width(), 1280);
  EXPECT_EQ(window_->problem()->sentence(), sentence);
  Click(window_.get(), "problem.details");
  EXPECT_EQ(run->mapTo(window_.get(), QPoint(0, 0)), before);
  EXPECT_TRUE(Child<QWidget>(window_.get(), "problem.text")->isVisible());
  Screenshot(window_.get(), "problem_bar");
  Click(window_.get(), "problem.close");
  EXPECT_FALSE(Child<QWidget>(window_.get(), "problem.text")->isVisible());
}

TEST_F(MendedTest, AClosedDockComesBackFromTheMenu) {
  auto* dock = Child<QDockWidget>(window_.get(), "site");
  dock->close();
  EXPECT_FALSE(dock->isVisible());
  QAction* site = nullptr;
  for (QAction* menu : window_->menuBar()->actions()) {
    for (QAction* action : menu->menu()->actions()) {
      if (action->text() == "Site") site = action;
    }
  }
  ASSERT_NE(site, nullptr);
  site->trigger();
  EXPECT_TRUE(dock->isVisible());
}

TEST_F(MendedTest, OneRunIsComparedWithAll) {
  window_->ShowDesk("compare");
  auto* errors = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4; }));
  Child<QComboBox>(window_.get(), "compare.run_a")->setCurrentIndex(1);
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4; }));
  EXPECT_THAT(Child<QLabel>(window_.get(), "compare.note")->text().toStdString(), HasSubstr("run1"));
  EXPECT_TRUE(Child<QLabel>(window_.get(), "compare.note")->isVisible());
  EXPECT_EQ(errors->item(RowWith(errors, "S1"), 7)->text(), "0.0200");
}

TEST_F(MendedTest, BlankNumbersComeLastInEitherOrder) {
  QTableWidget table(4, 1);
  const char* texts[] = {"10", "", "9", "-1"};
  for (int row = 0; row < 4; ++row) table.setItem(row, 0, new NumberItem(texts[row]));
  const auto order = [&](Qt::SortOrder way) {
    table.sortByColumn(0, way);
    QStringList all;
    for (int row = 0; row < 4; ++row) all << table.item(row, 0)->text();
    return all.join(' ').toStdString();
  };
  EXPECT_EQ(order(Qt::AscendingOrder), "-1 9 10 ");
  EXPECT_EQ(order(Qt::DescendingOrder), "10 9 -1 ");
}

TEST_F(MendedTest, AProjectOpenedAgainHasNoSelectionOnAnyDesk) {
  window_->workspace()->Select("station:S2");
  QSignalSpy selected(window_->workspace(), &Workspace::Selected);
  const auto before = window_->workspace()->snapshot();
  window_->OpenProject(site_->path());
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->snapshot() != before; }));
  EXPECT_EQ(window_->workspace()->selected(), "");
  ASSERT_EQ(selected.count(), 1);
  EXPECT_EQ(selected[0][0].toString(), "");
}

// Whose project went away, or was left, before the decision was read again.
TEST_F(MendedTest, AReloadOutlastsAnOpeningThatFails) {
  Workspace* workspace = window_->workspace();
  QSignalSpy opened(workspace, &Workspace::Opened), problems(workspace, &Workspace::Problem);
  workspace->Open(site_->path() + "/nowhere");
  workspace->Reload();  // as the end of a run does
  EXPECT_TRUE(WaitFor([&] { return problems.count() > 0 && opened.count() > 0; }));
  EXPECT_EQ(workspace->dir(), site_->path());
}

TEST_F(MendedTest, ADecisionIsNotTakenForOneOfAnotherProject) {
  QTemporaryDir first;
  const QString site = first.filePath("site");
  WriteResultsSite(site.toStdString(), {});
  window_->OpenProject(site);
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == site; }));
  QSignalSpy decided(window_->decisions(), &Decisions::Decided), problems(window_->workspace(), &Workspace::Problem);
  const auto open_other = [&] {
    window_->OpenProject(site_->path());
    return WaitFor([&] { return window_->workspace()->dir() == site_->path() && !window_->workspace()->opening(); });
  };
  // Left at once: the other one is opened, and nothing of the first can be made again there.
  window_->decisions()->Decide("exclude", "station:S1", "was moved");
  ASSERT_TRUE(open_other());
  window_->OpenProject(site);
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == site && !window_->workspace()->opening(); }));
  ASSERT_TRUE(WaitFor([&] { return QFile::exists(site + "/review.jsonl"); }));
  EXPECT_EQ(decided.count(), 0);
  // Gone before it is read again.
  const qint64 size = QFileInfo(site + "/review.jsonl").size();
  window_->decisions()->Decide("exclude", "station:S2", "was moved");
  while (QFileInfo(site + "/review.jsonl").size() == size) QThread::yieldCurrentThread();
  ASSERT_TRUE(QDir().rename(site, first.filePath("gone")));
  ASSERT_TRUE(WaitFor([&] { return problems.count() > 0; }));
  ASSERT_TRUE(open_other());
  EXPECT_EQ(decided.count(), 0);
}

TEST_F(MendedTest, ASelectionUnfoldsNoRun) {
  const auto items = window_->tree()->findItems("run1", Qt::MatchExactly | Qt::MatchRecursive);
  ASSERT_FALSE(items.isEmpty());
  EXPECT_FALSE(items.front()->isExpanded());
  window_->workspace()->Select("image:run1/images/000007.jpg");
  EXPECT_FALSE(items.front()->isExpanded());
  EXPECT_EQ(window_->tree()->currentItem()->text(0), "images/000007.jpg");
}

}  // namespace
}  // namespace trigpoint
