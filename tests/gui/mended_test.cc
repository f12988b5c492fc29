// What used to stay, move or be cut: other projects' pictures, the bar with problems, narrow windows, folded trees.
#include <gmock/gmock.h>

#include <QAction>
#include <QCheckBox>
#include <QComboBox>
#include <QDockWidget>
#include <QHelpEvent>
#include <QLabel>
#include <QSignalSpy>
#include <QStyleOptionComboBox>
#include <QTableWidget>
#include <QThread>
#include <QToolTip>
#include <map>
#include <string>
#include <vector>

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

using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::UnorderedElementsAre;

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
  QAction* site = MenuAction("Site");
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

TEST(WithoutAProject, DesksSayWhatToDo) {
  QSettings().clear();
  const auto window = OpenWindow("");
  const std::pair<const char*, const char*> kLabels[] = {
      {"compare", "compare.note"}, {"review", "review.empty"}, {"calibration", "calibration.text"}};
  for (const auto& [desk, name] : kLabels) {
    window->ShowDesk(desk);
    const auto* label = Child<QLabel>(window.get(), name);
    EXPECT_TRUE(label->isVisible()) << desk;
    EXPECT_TRUE(label->isEnabled()) << desk;
    EXPECT_THAT(label->text().toStdString(), HasSubstr("Open a project (Ctrl+O)")) << desk;
  }
  for (const char* desk : {"panoramas", "calibration"}) {
    window->ShowDesk(desk);
    for (const PictureView* view : window->findChildren<PictureView*>()) {
      EXPECT_TRUE(!view->isVisible() || !view->accessibleDescription().isEmpty()) << desk;
    }
  }
  EXPECT_THAT(Child<PictureView>(window.get(), "panorama.picture")->accessibleDescription().toStdString(),
              HasSubstr("Open a project (Ctrl+O)"));
  Screenshot(window.get(), "empty_calibration");
}

// Also where the desk was seen before there was anything to choose.
TEST_F(MendedTest, BoxesShowTheirTexts) {
  const auto window = OpenWindow("");
  const std::pair<const char*, const char*> kBoxes[] = {{"compare", "compare.a"},     {"compare", "compare.run_a"},
                                                        {"review", "review.variant"}, {"images", "images.reference"},
                                                        {"images", "images.run"},     {"panoramas", "panorama.set"}};
  for (const auto& [desk, name] : kBoxes) {
    window->ShowDesk(desk);
    QTest::qWait(20);
  }
  window->OpenProject(site_->path());
  ASSERT_TRUE(WaitFor([&] { return Child<QComboBox>(window.get(), "images.reference")->count() > 0; }));
  for (const auto& [desk, name] : kBoxes) {
    window->ShowDesk(desk);
    QTest::qWait(20);
    auto* box = Child<QComboBox>(window.get(), name);
    QStyleOptionComboBox option;
    option.initFrom(box);
    const int room =
        box->style()->subControlRect(QStyle::CC_ComboBox, &option, QStyle::SC_ComboBoxEditField, box).width();
    ASSERT_GT(box->count(), 0) << name;
    for (int i = 0; i < box->count(); ++i) {
      EXPECT_LE(box->fontMetrics().horizontalAdvance(box->itemText(i)), room) << name;
    }
    QHelpEvent asked(QEvent::ToolTip, {3, 3}, box->mapToGlobal({3, 3}));
    QApplication::sendEvent(box, &asked);
    EXPECT_THAT(QToolTip::text().toStdString(), HasSubstr(box->currentText().toStdString())) << name;
  }
  QToolTip::hideText();
}

TEST_F(MendedTest, ControlsAndColumnsSayWhatTheyAreFor) {
  for (const char* name :
       {"images.run", "images.reference", "images.detections", "images.tracks", "images.inliers", "images.outliers",
        "compare.a", "compare.b", "compare.run_a", "compare.run_b", "compare.other", "compare.views", "review.object",
        "review.reason", "review.user", "review.variant", "review.views"}) {
    EXPECT_NE(Child<QWidget>(window_.get(), name)->toolTip(), "") << name;
  }
  for (const char* name : {"review.entries", "review.changes", "check.next", "check.findings"}) {
    const auto* table = Child<QTableWidget>(window_.get(), name);
    for (int c = 0; c < table->columnCount(); ++c) EXPECT_NE(table->horizontalHeaderItem(c)->toolTip(), "") << name;
  }
}

// Errors of both kinds of answers against every reference, with one that was refused.
class AnswersTest : public testing::Test {
 protected:
  void SetUp() override {
    QSettings().clear();
    WriteResultsSite(site_.path().toStdString(), {});
    Write(1);
    window_ = OpenWindow(site_.path());
  }
  // Errors `factor` times as large.
  void Write(double factor) {
    for (const char* folder : {"/results/evaluate", "/results/evaluate@trial"}) {
      const std::string file = site_.path().toStdString() + folder + "/errors.csv";
      if (whole_.count(folder) == 0) whole_[folder] = ReadTextFile(file);
      const std::string variant = std::string(folder).ends_with("trial") ? "trial" : "";
      const auto row = [&](const char* method, int station, const char* reference, const std::string& rest) {
        const std::string n = std::to_string(station);
        return "run1," + variant + "," + method + ",S" + n + ",panoramas/p00" + n + ".jpg," + n + "," + reference +
               ",relative," + rest + "\n";
      };
      const std::string e = std::to_string(0.5 * factor);
      const std::string answered = "localized,," + e + "," + e + ",0," + e + ",0,0,,0.05,0.05,0.08,1,3";
      const std::string refused = factor > 1 ? answered : "rejected,few inliers,,,,,,,,,,,,";
      const std::string text = whole_[folder];
      const size_t rows = text.find('\n', text.find("run,")) + 1;
      WriteFileAtomically(file, text.substr(0, rows) + row("g1", 1, "self", answered) + text.substr(rows) +
                                    row("single", 2, "self", answered) + row("single", 3, "survey", refused));
    }
  }
  static std::vector<std::string> Column(const QAbstractItemView* view, int column) {
    std::vector<std::string> all;
    for (int row = 0; row < view->model()->rowCount(); ++row) {
      all.push_back(view->model()->index(row, column).data().toString().toStdString());
    }
    return all;
  }
  QTemporaryDir site_;
  std::map<std::string, std::string> whole_;
  std::unique_ptr<MainWindow> window_;
};

TEST_F(AnswersTest, CompareShowsFinalAnswersInTheWordsOfTheCard) {
  window_->ShowDesk("compare");
  auto* errors = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 5; })) << errors->rowCount();
  EXPECT_THAT(Column(errors, 1), Each("panorama (G2)"));
  EXPECT_THAT(Column(errors, 0), IsSupersetOf({"surveyed control", "the run's own tags"}));
  Child<QCheckBox>(window_.get(), "compare.views")->setChecked(true);
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 6; }));
  EXPECT_THAT(Column(errors, 1), Contains("view (G1)"));
  Screenshot(window_.get(), "compare_words");
}

TEST_F(AnswersTest, ReviewShowsFinalAnswersInTheWordsOfTheCard) {
  window_->ShowDesk("review");
  WriteFileAtomically(site_.filePath("trigpoint.yaml").toStdString(), "stages: {detect: {nonsense: 1}}\n");
  Click(window_.get(), "review.solve");  // fails at once: what changes then is the file alone
  ASSERT_TRUE(WaitFor([&] { return !window_->jobs()->running() && !window_->workspace()->opening(); }));
  Write(10);
  Child<QCheckBox>(window_.get(), "review.small")->setChecked(true);
  const auto* changes = Child<QTableWidget>(window_.get(), "review.changes");
  ASSERT_EQ(changes->rowCount(), 2);
  EXPECT_THAT(Column(changes, 0), UnorderedElementsAre("the run's own tags", "the tag map"));
  EXPECT_THAT(Column(changes, 1), Each("panorama (G2)"));
  EXPECT_THAT(Column(changes, 7), Contains("refused"));
  Child<QCheckBox>(window_.get(), "review.views")->setChecked(true);
  EXPECT_EQ(changes->rowCount(), 3);
  EXPECT_THAT(Column(changes, 1), Contains("view (G1)"));
}

TEST_F(AnswersTest, TablesListFinalAnswersFirst) {
  window_->ShowDesk("tables");
  ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/errors"); }));
  const auto* view = Child<QTableView>(window_.get(), "tables.view");
  ASSERT_TRUE(WaitFor([&] { return view->model()->rowCount() == 7; }));
  EXPECT_EQ(Column(view, 2).front(), "panorama (G2)");
  EXPECT_EQ(Column(view, 2).back(), "view (G1)");
  EXPECT_THAT(Column(view, 6), Contains("the run's own tags"));
  EXPECT_THAT(Column(view, 8), Contains("refused"));
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
