// Forms: options in groups that are found by a word, choices as boxes, errors at the field, a question before something
// long is computed again; exports and help from the menus.
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QLabel>
#include <QLineEdit>
#include <QMenu>
#include <QMenuBar>
#include <QMessageBox>
#include <QPlainTextEdit>
#include <QSignalSpy>
#include <QTabWidget>
#include <QTableWidget>
#include <QTextBrowser>
#include <QToolButton>

#include "app/desktop/action_dialog.h"
#include "app/desktop/icons.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/stage_graph.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class FormsTest : public ResultsWindowTest {
 protected:
  QWidget* Option(const char* name) { return Child<QWidget>(window_.get(), (std::string("option.") + name).c_str()); }
};

TEST_F(FormsTest, OptionsStandInGroupsAndAreFoundByAWord) {
  window_->ShowDesk("run");
  window_->run_desk()->Choose("localize", "");
  QTest::qWait(50);  // until the form is laid out
  QWidget* mode = Option("mode");
  auto* box = qobject_cast<QComboBox*>(mode);
  ASSERT_NE(box, nullptr);  // an enumeration
  EXPECT_GE(box->findText("paper"), 0);
  EXPECT_GE(box->findText("trigpoint"), 0);
  QWidget* gps = Option("geo.use_gps");
  ASSERT_NE(qobject_cast<QComboBox*>(gps), nullptr);
  EXPECT_TRUE(gps->isVisibleTo(window_.get()));
  Type(window_.get(), "option.filter", "only without geotagged");  // of its help
  EXPECT_TRUE(gps->isVisibleTo(window_.get()));
  EXPECT_FALSE(mode->isVisibleTo(window_.get()));
  Screenshot(window_.get(), "run_found");
  Child<QLineEdit>(window_.get(), "option.filter")->clear();
  EXPECT_TRUE(mode->isVisibleTo(window_.get()));
  box->setCurrentText("paper");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("mode=\"paper\""));
  Screenshot(window_.get(), "run_groups");
}

TEST_F(FormsTest, StagesAreDrawnBelowThoseTheyNeedAndAClickChoosesOne) {
  window_->ShowDesk("run");
  auto* graph = Child<StageGraph>(window_.get(), "run.graph");
  ASSERT_NE(graph, nullptr);
  const std::vector<StageBox>& boxes = graph->boxes();
  const auto named = [&](const std::string& stage) {
    const auto it = std::find_if(boxes.begin(), boxes.end(), [&](const StageBox& b) { return b.stage == stage; });
    return static_cast<size_t>(it - boxes.begin());
  };
  const size_t features = named("features"), reconstruct = named("reconstruct"), localize = named("localize");
  ASSERT_LT(std::max({features, reconstruct, localize}), boxes.size());
  EXPECT_THAT(boxes[reconstruct].needs, testing::ElementsAre(features));
  EXPECT_THAT(boxes[localize].needs, testing::Contains(reconstruct));
  EXPECT_THAT(boxes[localize].needs, testing::Not(testing::Contains(features)));  // through reconstruct
  for (size_t b = 0; b < boxes.size(); ++b) {
    for (const size_t a : boxes[b].needs) EXPECT_LT(graph->RectOf(a).bottom(), graph->RectOf(b).top());
    for (size_t a = 0; a < b; ++a) EXPECT_FALSE(graph->RectOf(a).intersects(graph->RectOf(b)));
  }
  QTest::mouseClick(graph, Qt::LeftButton, {}, graph->RectOf(reconstruct).center().toPoint());
  EXPECT_EQ(Child<QComboBox>(window_.get(), "run.stage")->currentData().toString(), "reconstruct");
  Screenshot(window_.get(), "run_graph");
}

TEST_F(FormsTest, AnErrorStandsAtItsField) {
  window_->ShowDesk("run");
  window_->run_desk()->Choose("detect", "");
  QTest::qWait(50);
  auto* problem = Child<QLabel>(window_.get(), "problem.min_margin");
  EXPECT_FALSE(problem->isVisible());
  Type(window_.get(), "option.min_margin", "-1");
  EXPECT_TRUE(problem->isVisible());
  EXPECT_THAT(problem->text().toStdString(), HasSubstr("min_margin"));
  EXPECT_FALSE(Child<QLabel>(window_.get(), "problem.family")->isVisible());
  Type(window_.get(), "option.min_margin", "40");
  EXPECT_FALSE(problem->isVisible());
}

TEST_F(FormsTest, OneIsAskedBeforeSomethingLongIsComputedAgain) {
  // A result that took an hour and whose inputs are others now.
  WriteFileAtomically(Path("results/detect/run1/manifest.json").toStdString(),
                      R"({"schema": 1, "stage": "detect", "name": "run1", "identity": "of other inputs",
                          "wall_seconds": 3600.0, "metrics": {}})");
  window_->workspace()->Reload();
  auto* results = Child<QTableWidget>(window_.get(), "run.results");
  const auto state = [&] {
    const int row = RowWith(results, "detect/run1");
    return row < 0 ? std::string() : results->item(row, 1)->text().toStdString();
  };
  ASSERT_TRUE(WaitFor([&] { return state() == "out of date"; })) << state();
  window_->ShowDesk("run");
  window_->run_desk()->Choose("detect", "run1");
  EXPECT_THAT(Child<QLabel>(window_.get(), "run.expected")->text().toStdString(), HasSubstr("1:00:00"));
  Click(window_.get(), "run.run");
  auto* ask = Child<QMessageBox>(window_.get(), "run.ask");
  ASSERT_NE(ask, nullptr);
  EXPECT_THAT(ask->text().toStdString(), HasSubstr("1:00:00"));
  EXPECT_FALSE(window_->jobs()->running());
  ask->button(QMessageBox::No)->click();
  QTest::qWait(100);
  EXPECT_FALSE(window_->jobs()->running());
  Screenshot(window_.get(), "run_results");
  QFile::remove(Path("results/detect/run1/manifest.json"));
}

TEST_F(FormsTest, FilesAndFoldersAreChosenByADialog) {
  window_->ShowDesk("run");
  window_->run_desk()->Choose("plan", "");
  QTest::qWait(50);
  const auto value = [&](const char* name) { return qobject_cast<QLineEdit*>(Option(name))->text(); };
  Click(window_.get(), "option.sketch_browse");
  ChoosePath(window_.get(), Path("stations.csv"));
  EXPECT_EQ(value("sketch"), "stations.csv");  // relative to the project
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("stations.csv"));
  QTemporaryDir elsewhere;
  WriteFileAtomically(elsewhere.filePath("camchain.yaml").toStdString(), "{}\n");
  Click(window_.get(), "option.camera_browse");
  ChoosePath(window_.get(), elsewhere.filePath("camchain.yaml"));
  EXPECT_EQ(value("camera"), elsewhere.filePath("camchain.yaml"));
  Screenshot(window_.get(), "run_paths");
  window_->run_desk()->Choose("calibrate", "");
  QTest::qWait(50);
  Click(window_.get(), "option.images_browse");
  ChoosePath(window_.get(), Path("panoramas/p000.jpg"));
  EXPECT_EQ(value("images"), "panoramas/*.jpg");
  EXPECT_EQ(window_->findChild<QWidget*>("option.from_camera_browse"), nullptr);  // that is no path
}

TEST_F(FormsTest, TheCommandOfAnActionRunsAsItStands) {
  const auto line = [](QWidget* dialog) { return Child<QLineEdit>(dialog, "action.line")->text(); };
  MenuAction("Export ...")->trigger();
  auto* dialog = Child<ActionDialog>(window_.get(), "action.export");
  EXPECT_EQ(line(dialog), "trigpoint export " + site_->path() + " --to gpkg");
  Type(dialog, "option.out", "out/site.gpkg");
  EXPECT_EQ(line(dialog), "trigpoint export " + site_->path() + " --out " + Path("out/site.gpkg") + " --to gpkg");
  const QList<QAction*> kinds = Child<QToolButton>(dialog, "option.out_browse")->menu()->actions();
  ASSERT_EQ(kinds.size(), 2);
  kinds[0]->trigger();
  ChoosePath(dialog, Path("new.gpkg"));  // that is not there yet
  EXPECT_EQ(Child<QLineEdit>(dialog, "option.out")->text(), "new.gpkg");
  Child<QToolButton>(dialog, "option.out_browse")->menu()->actions()[1]->trigger();
  ChoosePath(dialog, Path("panoramas"));
  EXPECT_EQ(Child<QLineEdit>(dialog, "option.out")->text(), "panoramas");
  Click(dialog, "action.close");
  MenuAction("Publish ...")->trigger();
  dialog = Child<ActionDialog>(window_.get(), "action.publish");
  EXPECT_FALSE(Child<QAbstractButton>(dialog, "action.run")->isEnabled());  // by which name?
  Type(dialog, "option.name", "2026-05");
  EXPECT_TRUE(Child<QAbstractButton>(dialog, "action.run")->isEnabled());
  Type(dialog, "option.sign", "gpg:office");
  EXPECT_EQ(line(dialog), "trigpoint publish " + site_->path() + " --name 2026-05 --sign gpg:office");
  Click(dialog, "action.close");
}

TEST_F(FormsTest, ResultsAreExportedFromTheMenu) {
  MenuAction("Export ...")->trigger();
  auto* dialog = Child<ActionDialog>(window_.get(), "action.export");
  ASSERT_NE(dialog, nullptr);
  auto* to = Child<QComboBox>(dialog, "option.to");
  EXPECT_GE(to->count(), 5);
  to->setCurrentText("csv");
  const QTemporaryDir out;
  Type(dialog, "option.out", out.filePath("site"));
  EXPECT_EQ(Child<QLineEdit>(dialog, "action.line")->text().toStdString(),
            ("trigpoint export " + site_->path() + " --out " + out.filePath("site") + " --to csv").toStdString());
  QSignalSpy done(dialog, &ActionDialog::Done);
  Screenshot(dialog, "export");
  Click(dialog, "action.run");
  ASSERT_TRUE(WaitFor([&] { return done.count() == 1; }));
  const std::string outcome = Child<QPlainTextEdit>(dialog, "action.outcome")->toPlainText().toStdString();
  EXPECT_TRUE(done[0][0].toBool()) << outcome;
  EXPECT_FALSE(QDir(out.filePath("site")).entryList({"*.csv"}).isEmpty()) << outcome;
  Click(dialog, "action.close");
}

TEST_F(FormsTest, PhotosAreImportedFromTheMenu) {
  const QTemporaryDir photos;
  ASSERT_TRUE(QFile::copy(Path("panoramas/p000.jpg"), photos.filePath("a.jpg")));
  MenuAction("Import ...")->trigger();
  auto* dialog = Child<ActionDialog>(window_.get(), "action.import");
  EXPECT_FALSE(Child<QAbstractButton>(dialog, "action.run")->isEnabled());  // of what?
  EXPECT_GE(Child<QComboBox>(dialog, "option.as")->findText("tag-layout"), 0);
  Type(dialog, "option.from", photos.path());
  Type(dialog, "option.name", "corner");
  Screenshot(dialog, "import");
  QSignalSpy done(dialog, &ActionDialog::Done);
  Click(dialog, "action.run");
  ASSERT_TRUE(WaitFor([&] { return done.count() == 1; }));
  const std::string outcome = Child<QPlainTextEdit>(dialog, "action.outcome")->toPlainText().toStdString();
  EXPECT_TRUE(done[0][0].toBool()) << outcome;
  EXPECT_THAT(outcome, HasSubstr("photos: 1 new file"));
  EXPECT_TRUE(QFile::exists(Path("photos/corner/a.jpg")));
  Click(dialog, "action.close");
  QDir(Path("photos")).removeRecursively();
}

TEST_F(FormsTest, PlansAndCrossChecksAreStagesOfTheRunDesk) {
  MenuAction("Plan a survey ...")->trigger();
  EXPECT_EQ(window_->desk(), "plan");
  Click(window_.get(), "plan.options");
  EXPECT_EQ(window_->desk(), "run");
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "run.command")->text(), "trigpoint plan " + site_->path());
  EXPECT_NE(qobject_cast<QComboBox*>(Option("suggest")), nullptr);
  MenuAction("Cross-check with COLMAP ...")->trigger();
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("trigpoint crosscheck"));
  MenuAction("Print tags and boards ...")->trigger();
  EXPECT_EQ(window_->desk(), "print");
}

TEST_F(FormsTest, HelpListsEveryShortcutOfTheMenus) {
  MenuAction("Keys and terms")->trigger();
  const auto* text = Child<QTextBrowser>(window_.get(), "help.text");
  const std::string all = text->toPlainText().toStdString();
  int shortcuts = 0;
  for (QAction* menu : window_->menuBar()->actions()) {
    for (QAction* action : menu->menu()->actions()) {
      if (action->shortcut().isEmpty()) continue;
      ++shortcuts;
      EXPECT_THAT(all, HasSubstr(action->shortcut().toString(QKeySequence::NativeText).toStdString()));
    }
  }
  EXPECT_GT(shortcuts, 15);
  EXPECT_THAT(all, HasSubstr("panorama (G2)"));
  Screenshot(text->window(), "help");
}

TEST_F(FormsTest, IconsFollowTheThemeAndTabsTheRoom) {
  auto* desks = Child<QTabWidget>(window_.get(), "desks");
  const auto ink = [&](int tab) {
    const QImage image = desks->tabIcon(tab).pixmap(32, 32).toImage();
    int lightness = -1;
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {
        if (image.pixelColor(x, y).alpha() == 255) lightness = image.pixelColor(x, y).lightness();
      }
    }
    return lightness;
  };
  window_->SetTheme("light");
  window_->resize(2400, 900);
  QTest::qWait(50);
  for (int tab = 0; tab < desks->count(); ++tab) {
    EXPECT_GE(ink(tab), 0) << tab;
    EXPECT_LT(ink(tab), 100) << tab;
  }
  window_->SetTheme("dark");
  EXPECT_GT(ink(0), 180);
  window_->SetTheme("system");
  EXPECT_EQ(desks->tabText(3), "Images");
  window_->resize(1400, 900);  // names matter more than icons
  QTest::qWait(50);
  EXPECT_EQ(desks->tabText(3), "Images");
  EXPECT_TRUE(desks->tabIcon(3).isNull());
  window_->resize(1024, 700);
  QTest::qWait(50);
  EXPECT_EQ(desks->tabText(3), "");
  EXPECT_FALSE(desks->tabIcon(3).isNull());
  EXPECT_EQ(desks->tabToolTip(3), "Images");
  EXPECT_TRUE(IconNamed("nothing of that name").isNull());
}

}  // namespace
}  // namespace trigpoint
