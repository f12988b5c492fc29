// The overview: what a project opens on.
#include "app/desktop/overview.h"

#include <gmock/gmock.h>

#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QMenu>
#include <QPushButton>
#include <QScrollArea>
#include <QScrollBar>
#include <QSignalSpy>
#include <QTableWidget>
#include <filesystem>
#include <sstream>

#include "app/desktop/decisions.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "app/pipeline/jobs.h"
#include "datasets/io/text.h"
#include "datasets/project/project.h"
#include "datasets/project/review.h"
#include "eval/scene/scene_model.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* kSummary = R"({"schema": "trigpoint evaluate 1", "groups": [{"variant": "", "method": "single",
  "reference": "control", "kind": "absolute", "shares_evidence": false, "answers": 4, "attempts": 4,
  "error_3d": {"over_answers": {"median_m": 0.025, "p90_m": 0.037, "max_m": 0.04}}}]})";
constexpr const char* kGates = R"({"schema": "trigpoint gates 1", "verdict": "failed",
  "gates": [{"verdict": "failed", "message": "median 0.025 m exceeds 0.02 m"}]})";

class OverviewTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    WriteFileAtomically(Path("trigpoint.yaml").toStdString(), "name: overview\n");
    WriteFileAtomically(Path("results/evaluate/summary.json").toStdString(), kSummary);
    WriteFileAtomically(Path("results/gates/gates.json").toStdString(), kGates);
    ResultsWindowTest::SetUp();
    ASSERT_EQ(window_->desk(), "overview");
    ASSERT_TRUE(WaitFor([&] { return Matrix() != nullptr; }));
  }
  QTableWidget* Matrix() { return window_->findChild<QTableWidget*>("overview.matrix"); }
  std::string Words() {
    QString all;
    for (const auto* label : window_->overview()->findChildren<QLabel*>()) all += label->text() + "\n";
    return all.toStdString();
  }
};

TEST_F(OverviewTest, ShowsTheVerdictAndTheErrorsByStationAndRun) {
  EXPECT_THAT(Words(), HasSubstr("Quality gates: failed"));
  EXPECT_THAT(Words(), HasSubstr("median 0.025 m exceeds 0.02 m"));
  EXPECT_THAT(Words(), HasSubstr("4 of 4"));
  EXPECT_THAT(Words(), HasSubstr("absolute, against surveyed control"));
  EXPECT_THAT(Words(), HasSubstr("Largest error: run1 at S3"));
  ASSERT_EQ(Matrix()->rowCount(), 4);
  ASSERT_EQ(Matrix()->columnCount(), 1);
  const std::string cell = Matrix()->item(1, 0)->text().toStdString();
  EXPECT_THAT(cell, HasSubstr("0.020"));
  EXPECT_THAT(cell, HasSubstr("0.107"));  // of 0.05, 0.05 and 0.08 m
  EXPECT_FALSE(window_->overview()->plan()->image().isNull());
  Screenshot(window_.get(), "overview");
  window_->workspace()->SetUnit("ft");
  EXPECT_TRUE(WaitFor([&] { return Matrix()->item(1, 0)->text().startsWith("0.066"); }));
}

TEST_F(OverviewTest, ACellAPlaceAndATreeSelectTheSameStation) {
  auto* card = Child<QTableWidget>(window_.get(), "card.table");
  EXPECT_FALSE(card->isVisible());
  const QRect cell = Matrix()->visualItemRect(Matrix()->item(2, 0));
  QTest::mouseClick(Matrix()->viewport(), Qt::LeftButton, {}, cell.center());
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  ASSERT_EQ(card->rowCount(), 2);  // what is compared, and the run
  EXPECT_TRUE(card->isVisible());
  EXPECT_EQ(card->item(0, 0)->toolTip(), "absolute, panorama (G2), against surveyed control");
  EXPECT_EQ(card->item(0, 0)->text(), "absolute, panorama (G2)\nagainst surveyed control");
  const char* expected[] = {"run1", "0.030", "0.107", "0.1", "0.030", "0.000", "0.000", "0.33"};
  for (int c = 0; c < card->columnCount(); ++c) EXPECT_EQ(card->item(1, c)->text(), expected[c]) << c;
  EXPECT_THAT(Child<QLabel>(window_.get(), "card.title")->text().toStdString(), HasSubstr("Station S2, tag 2"));
  for (const char* desk : {"scene", "images", "tables", "compare", "review"}) {  // the same beside every desk
    window_->ShowDesk(desk);
    EXPECT_TRUE(card->isVisible()) << desk;
    EXPECT_EQ(card->item(1, 1)->text(), "0.030") << desk;
  }
  window_->ShowDesk("overview");
  window_->workspace()->Select("panorama:panoramas/p001.jpg");
  EXPECT_EQ(Matrix()->currentRow(), 1);
  EXPECT_EQ(card->item(1, 1)->text(), "0.020");
  PictureView* plan = window_->overview()->plan();
  ASSERT_EQ(plan->marks().size(), 4u);
  QTest::mouseClick(plan, Qt::LeftButton, {}, plan->WidgetAt(plan->marks()[3].points[0]).toPoint());
  EXPECT_EQ(window_->workspace()->selected(), "station:S3");
  EXPECT_EQ(Matrix()->currentRow(), 3);
  Screenshot(window_.get(), "overview_station");
  Click(window_.get(), "card.scene");
  EXPECT_EQ(window_->desk(), "scene");
  ASSERT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
  // Looked at: in the middle of the view.
  EXPECT_TRUE(WaitFor([&] {
    const QWidget* view = Child<QWidget>(window_.get(), "scene.view");
    const QPointF at = window_->scene()->PlaceOf("panorama:panoramas/p003.jpg") / view->devicePixelRatioF();
    return (at - QPointF(view->rect().center())).manhattanLength() < 40;
  }));
}

TEST_F(OverviewTest, TheCardShowsErrorSigmaToleranceAndAxesAtItsFirstWidth) {
  window_->workspace()->Select("station:S2");
  auto* card = Child<QTableWidget>(window_.get(), "card.table");
  ASSERT_EQ(card->rowCount(), 2);
  ASSERT_TRUE(WaitFor([&] { return card->isVisible() && card->viewport()->width() > 100; }));
  const QStringList first{"run", "3D", QString::fromUtf8("\xcf\x83 3D"), "tol.", "dE", "dN", "dU"};
  for (int c = 0; c < first.size(); ++c) EXPECT_EQ(card->horizontalHeaderItem(c)->text(), first[c]);
  EXPECT_LE(card->columnViewportPosition(6) + card->columnWidth(6), card->viewport()->width());
  QFont bold = card->font();
  bold.setBold(true);
  for (const QString& line : card->item(0, 0)->text().split('\n')) {
    EXPECT_LT(QFontMetrics(bold).horizontalAdvance(line), card->viewport()->width()) << line.toStdString();
  }
  EXPECT_GE(card->rowHeight(0), 2 * QFontMetrics(bold).height());
}

TEST_F(OverviewTest, TheCardSaysWhoseResultsTheSceneShows) {
  ShowScene();
  window_->workspace()->Select("station:S2");
  auto* card = Child<QTableWidget>(window_.get(), "card.table");
  const auto* note = Child<QLabel>(window_.get(), "card.note");
  EXPECT_EQ(card->item(1, 1)->text(), "0.030");
  EXPECT_THAT(note->text().toStdString(), HasSubstr("Results: the first ones."));
  auto* variant = Child<QComboBox>(window_.get(), "scene.variant");
  variant->setCurrentIndex(variant->findData("trial"));
  EXPECT_EQ(card->item(1, 1)->text(), "0.060");
  EXPECT_THAT(note->text().toStdString(), HasSubstr("Results: variant trial."));
  window_->ShowDesk("overview");  // whose matrix is of the first ones
  EXPECT_EQ(card->item(1, 1)->text(), "0.030");
}

TEST_F(OverviewTest, WhatRunsOrIsNotCheckedIsNotUpToDate) {
  const Snapshot& snapshot = *window_->workspace()->snapshot();
  std::vector<SnapshotResult> results(2);
  results[0].state = "done";
  EXPECT_EQ(NextOf(snapshot, results, true).kind, NextStep::Kind::kChecking);
  results[1].title = "localize/run1", results[1].state = "running";
  EXPECT_EQ(NextOf(snapshot, results, true).kind, NextStep::Kind::kRunning);
  EXPECT_EQ(NextOf(snapshot, results, true).title, "localize/run1");
  auto* next = Child<QPushButton>(window_.get(), "overview.next");
  ASSERT_TRUE(WaitFor([&] { return next->isVisible(); }));
  window_->workspace()->SetState("localize/run1", "running");
  EXPECT_EQ(Child<QLabel>(window_.get(), "overview.next_text")->text(), "Running: localize/run1");
  EXPECT_FALSE(next->isVisible());
}

TEST_F(OverviewTest, AReloadKeepsThePlaceAndTheKeyboard) {
  window_->resize(1024, 420);
  auto* bar = Child<QScrollArea>(window_.get(), "overview.scroll")->verticalScrollBar();
  ASSERT_TRUE(WaitFor([&] { return bar->maximum() > 20; }));
  Matrix()->setFocus();
  Matrix()->setCurrentCell(1, 0);
  bar->setValue(bar->maximum() - 5);
  const int before = bar->value();
  QSignalSpy loaded(window_->overview(), &OverviewDesk::Loaded);
  window_->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return loaded.count() >= 1; }));
  EXPECT_TRUE(WaitFor([&] { return std::abs(bar->value() - before) < 3; }, 3000)) << bar->value() << " " << before;
  EXPECT_TRUE(Matrix()->hasFocus());
  EXPECT_EQ(Matrix()->currentRow(), 1);
}

TEST_F(OverviewTest, TakesTheColoursOfAnotherTheme) {
  const auto lightness = [this] {
    auto* tile = window_->overview()->findChild<QFrame*>("tile");
    if (tile == nullptr) return -1;
    const QImage image = tile->grab().toImage();
    return image.pixelColor(image.width() - 3, image.height() - 3).lightness();
  };
  window_->SetTheme("light");
  EXPECT_TRUE(WaitFor([&] { return lightness() > 160; })) << lightness();
  window_->SetTheme("dark");
  EXPECT_TRUE(WaitFor([&] { return lightness() >= 0 && lightness() < 90; })) << lightness();
  Screenshot(window_.get(), "overview_dark");
  window_->SetTheme("light");
  EXPECT_TRUE(WaitFor([&] { return lightness() > 160; })) << lightness();
  const QTableWidget* matrix = Matrix();
  QTest::qWait(200);
  EXPECT_EQ(Matrix(), matrix);  // made again once
  window_->SetTheme("system");
}

TEST_F(OverviewTest, RecentProjectsThatAreGoneAreNotListed) {
  const QString gone = "/nonexistent/site";
  QSettings().setValue("recent", QStringList{gone, site_->path()});
  EXPECT_EQ(window_->RecentProjects(), QStringList(site_->path()));
  window_->workspace()->Close();
  EXPECT_THAT(Words(), HasSubstr(site_->path().toStdString()));
  EXPECT_THAT(Words(), Not(HasSubstr(gone.toStdString())));
}

TEST_F(OverviewTest, AClickMakesTheSceneLookThereWithoutChangingTheDesk) {
  const auto looked_at = [this](const char* panorama) {
    window_->ShowDesk("scene");
    const QWidget* view = Child<QWidget>(window_.get(), "scene.view");
    const bool found = WaitFor([&] {
      if (!window_->scene()->HasScene()) return false;
      const QPointF at = window_->scene()->PlaceOf(panorama) / view->devicePixelRatioF();
      return (at - QPointF(view->rect().center())).manhattanLength() < 40;
    });
    window_->ShowDesk("overview");
    return found;
  };
  const auto click = [this](int row) {
    QTest::mouseClick(Matrix()->viewport(), Qt::LeftButton, {},
                      Matrix()->visualItemRect(Matrix()->item(row, 0)).center());
  };
  QSignalSpy looks(window_->overview(), &OverviewDesk::LookRequested);
  click(3);
  EXPECT_EQ(looks.count(), 1);
  EXPECT_EQ(window_->desk(), "overview");
  EXPECT_TRUE(looked_at("panorama:panoramas/p003.jpg"));  // as soon as there is a scene
  PictureView* plan = window_->overview()->plan();
  QTest::mouseClick(plan, Qt::LeftButton, {}, plan->WidgetAt(plan->marks()[0].points[0]).toPoint());
  EXPECT_EQ(window_->desk(), "overview");
  EXPECT_TRUE(looked_at("panorama:panoramas/p000.jpg"));
  window_->scene()->LookAt("station:S2");
  looks.clear();
  click(0);  // selected already
  EXPECT_EQ(looks.count(), 1);
  EXPECT_TRUE(looked_at("panorama:panoramas/p000.jpg"));
  // Enter and a double click go there.
  Matrix()->setFocus();
  QTest::keyClick(Matrix(), Qt::Key_Down);
  EXPECT_EQ(looks.count(), 2);
  EXPECT_EQ(window_->workspace()->selected(), "station:S1");
  QTest::keyClick(Matrix(), Qt::Key_Return);
  EXPECT_EQ(window_->desk(), "scene");
  window_->ShowDesk("overview");
  QTest::mouseDClick(plan, Qt::LeftButton, {}, plan->WidgetAt(plan->marks()[1].points[0]).toPoint());
  EXPECT_EQ(window_->desk(), "scene");
  EXPECT_EQ(window_->workspace()->selected(), "station:S1");
}

TEST_F(OverviewTest, ThePlanIsInTheUnitShown) {
  const auto* desk = window_->overview();
  const QImage metres = desk->plan()->image();
  EXPECT_THAT(desk->overview()->plan_caption, HasSubstr("(m)"));
  window_->workspace()->SetUnit("ft");
  EXPECT_TRUE(WaitFor([&] { return desk->overview()->plan_caption.find("(ft)") != std::string::npos; }));
  EXPECT_NE(desk->plan()->image(), metres);
}

TEST_F(OverviewTest, NextIsWhatStatusAdvises) {
  auto* next = Child<QPushButton>(window_.get(), "overview.next");
  ASSERT_TRUE(WaitFor([&] { return next->isVisible(); }));
  EXPECT_THAT(Child<QLabel>(window_.get(), "overview.next_text")->text().toStdString(),
              AllOf(HasSubstr(" results are missing or out of date; "), HasSubstr(" is first.")));
  EXPECT_THAT(Words(), Not(HasSubstr("Next: trigpoint")));  // one next step
  window_->workspace()->Close();
  EXPECT_FALSE(next->isVisible());
  EXPECT_EQ(Matrix(), nullptr);
  EXPECT_THAT(Words(), HasSubstr("Recent projects"));
  EXPECT_THAT(Words(), HasSubstr(site_->path().toStdString()));
  Screenshot(window_.get(), "welcome");
  QSignalSpy opened(window_->workspace(), &Workspace::Opened);
  emit Child<QLabel>(window_.get(), "overview.recent")->linkActivated("open:" + site_->path());
  EXPECT_TRUE(WaitFor([&] { return opened.count() == 1; }));
}

void WriteSiteWithoutResults(const std::filesystem::path& dir) {
  WriteResultsSite(dir, {});
  std::filesystem::remove_all(dir / "results");
  WriteFileAtomically(dir / "trigpoint.yaml", "name: made\n");
}

// Results that are up to date for the program, without computing any; `fails` is a stage, or empty.
void PretendResults(const std::filesystem::path& dir, const std::string& fails) {
  const Project project = Project::Open(dir);
  ProgressSink progress;
  for (const Job& job : PlanJobs(project, {})) {
    if (job.stage->not_needed && !job.stage->not_needed(project, job.target).empty()) continue;
    StageRequest request = MakeRequest(project, *job.stage, job.target);
    const bool failing = job.stage->name == fails;
    request.body = [failing](StageContext& context) {
      if (failing) throw InputError("the datum is missing");
      WriteFileAtomically(context.out / "index.html", "pretended");
    };
    const auto run = [&] { RunStage(project, request, 1, 1, progress, {}); };
    if (failing) {
      EXPECT_THROW(run(), InputError);  // a record of it is there now
    } else {
      run();
    }
  }
}

TEST(NextStepTest, AfterAFailureAndWhenNothingIsLeft) {
  QSettings().clear();
  const QTemporaryDir site;
  const std::filesystem::path dir = site.path().toStdString();
  WriteSiteWithoutResults(dir);
  PretendResults(dir, "survey");
  const auto window = OpenWindow(site.path());
  auto* desk = window->overview();
  desk->disconnect(window.get());  // nothing is run, no browser is opened
  QSignalSpy run(desk, &OverviewDesk::RunRequested), report(desk, &OverviewDesk::ReportRequested);
  auto* next = Child<QPushButton>(window.get(), "overview.next");
  const auto* text = Child<QLabel>(window.get(), "overview.next_text");
  ASSERT_TRUE(WaitFor([&] { return text->text().startsWith("Failed results: 1."); })) << text->text().toStdString();
  EXPECT_THAT(text->text().toStdString(), HasSubstr("survey: the datum is missing"));
  EXPECT_EQ(next->text().remove('&'), "Run again what failed");
  QTest::mouseClick(next, Qt::LeftButton);
  EXPECT_EQ(run.count(), 1);
  PretendResults(dir, "");
  window->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return text->text() == "Every result is up to date."; })) << text->text().toStdString();
  EXPECT_EQ(next->text().remove('&'), "Open the report");
  QTest::mouseClick(next, Qt::LeftButton);
  EXPECT_EQ(report.count(), 1);
}

TEST(NextStepTest, NumbersOfEarlierResultsAreSaidToBe) {
  QSettings().clear();
  const QTemporaryDir site;
  const std::filesystem::path dir = site.path().toStdString();
  WriteSiteWithoutResults(dir);
  PretendResults(dir, "");
  const auto window = OpenWindow(site.path());
  const auto words = [&] {
    QString all;
    for (const auto* label : window->overview()->findChildren<QLabel*>()) all += label->text() + "\n";
    return all;
  };
  const auto* text = Child<QLabel>(window.get(), "overview.next_text");
  ASSERT_TRUE(WaitFor([&] { return text->text() == "Every result is up to date."; })) << text->text().toStdString();
  EXPECT_FALSE(words().contains("belong to earlier results"));
  window->decisions()->Decide("exclude", "tag:1", "was moved");
  EXPECT_TRUE(WaitFor([&] { return words().contains("its numbers belong to earlier results"); }, 20000))
      << words().toStdString();
  EXPECT_FALSE(words().contains("Next: trigpoint")) << words().toStdString();  // there is one next step, above
  window->workspace()->Select("station:S1");
  const auto* title = Child<QLabel>(window.get(), "card.title");
  EXPECT_TRUE(WaitFor([&] {
    return title->text().contains("tag:1 excluded by the review: was moved; solve again to see its effect");
  })) << title->text().toStdString();
}

QString WordsOf(const MainWindow& window) {
  QString all;
  for (const auto* label : window.overview()->findChildren<QLabel*>()) all += label->text() + "\n";
  return all;
}

TEST(NextStepTest, OfAFolderOfPhotosIsToStitchThem) {
  QSettings().clear();
  const QTemporaryDir site;
  for (const char* name : {"/a.jpg", "/b.jpg", "/c.jpg"}) {
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(Qt::darkGreen);
    ASSERT_TRUE(photo.save(site.path() + name));
  }
  const QString set = site.path().section('/', -1);
  const auto window = OpenWindow(site.path());
  ASSERT_TRUE(WaitFor([&] { return WordsOf(*window).contains("<b>Found</b>"); }));
  EXPECT_THAT(WordsOf(*window).toStdString(),
              AllOf(HasSubstr("3 photos of the set " + set.toStdString() + ", to be stitched: a.jpg to c.jpg"),
                    HasSubstr("There are photos but no run")));
  Screenshot(window.get(), "overview_photos");
  Project::Init(site.path().toStdString());
  window->workspace()->Reload();
  const auto* text = Child<QLabel>(window.get(), "overview.next_text");
  EXPECT_TRUE(WaitFor([&] {
    return text->text() == "3 results are missing or out of date; stitch/" + set + " is first.";
  })) << text->text().toStdString();
  EXPECT_EQ(Child<QPushButton>(window.get(), "overview.next")->property("anchor").toString(), "do:run");
}

TEST(NextStepTest, AnEmptyFolderHasNoPhotos) {
  QSettings().clear();
  const QTemporaryDir site;
  const auto window = OpenWindow(site.path());
  ASSERT_TRUE(WaitFor([&] { return WordsOf(*window).contains("There are neither photos nor runs"); }));
  EXPECT_FALSE(WordsOf(*window).contains("photos but no run"));
}

TEST(NextStepTest, WhatADecisionReplacedIsKept) {
  const QTemporaryDir site;
  const std::filesystem::path dir = site.path().toStdString();
  WriteSiteWithoutResults(dir);
  PretendResults(dir, "");
  const auto decide = [&](const char* action, const char* object) {
    ReviewRequest request;
    request.action = action, request.object = object, request.reason = "a test", request.user = "anna";
    AppendReview(Project::Open(dir), request);
  };
  const JobQuery query = ReviewQuery("");
  EXPECT_TRUE(AreKept(*OpenSnapshot(dir), query));
  decide("exclude", "tag:1");
  EXPECT_FALSE(AreKept(*OpenSnapshot(dir), query));
  PretendResults(dir, "");
  decide("undo", "last");
  EXPECT_TRUE(AreKept(*OpenSnapshot(dir), query));
}

// Two runs past the same four stations; the second has a refusal and a panorama that it doesn't match.
class TwoRunsTest : public testing::Test {
 protected:
  void SetUp() override {
    namespace fs = std::filesystem;
    QSettings().clear();
    const fs::path dir = site_.path().toStdString(), results = dir / "results";
    WriteResultsSite(dir, {});
    for (const char* folder : {"runs", "results/localize"}) {
      fs::copy(dir / folder / "run1", dir / folder / "run2", fs::copy_options::recursive);
    }
    WriteFileAtomically(dir / "trigpoint.yaml", "name: two runs\n");
    WriteFileAtomically(results / "evaluate/summary.json", kSummary);
    WriteFileAtomically(
        results / "evaluate/errors.csv",
        ReadTextFile(results / "evaluate/errors.csv") +
            "run2,,single,S0,panoramas/p000.jpg,0,control,absolute,localized,,0.3,0.3,0,0.3,0,0,,0.05,0.05,0.08,1,3\n"
            "run2,,single,S1,panoramas/p001.jpg,1,control,absolute,rejected,only 12 of 20 matches agree on one "
            "pose,,,,,,,,,,,,\n"
            "run2,,single,S2,panoramas/p002.jpg,2,control,absolute,unmatched,no matches,,,,,,,,,,,,\n"
            "run1,,g1,S2,panoramas/p002.jpg,2,control,absolute,localized,,0.5,0.5,0,0.5,0,0,,,,,,\n");
    const auto warn = [&](const char* result, const char* warnings) {
      WriteFileAtomically(results / result / "manifest.json",
                          std::string(R"({"schema": 1, "warnings": [)") + warnings + "]}\n");
    };
    warn("localize/run1", R"("few matches at dusk", "an own one")");
    warn("localize/run2", R"("few matches at dusk")");
    // Geotags that contradict the run at two stations.
    std::istringstream lines(ReadTextFile(results / "localize/run1/panoramas.csv"));
    std::string table;
    for (std::string line; std::getline(lines, line);) {
      const bool off = line.find("p001") != std::string::npos || line.find("p003") != std::string::npos;
      if (!line.starts_with("#")) {
        line += line.starts_with("panorama,") ? ",geotag_de_m,geotag_dn_m,geotag_du_m,geotag_status"
                : off                         ? ",12,0,0,outlier"
                                              : ",0,0,0,used";
      }
      table += line + "\n";
    }
    WriteFileAtomically(results / "localize/run1/panoramas.csv", table);
    Open();
  }
  void Open() {
    window_ = OpenWindow(site_.path());
    ASSERT_TRUE(WaitFor([&] { return Matrix() != nullptr; }));
  }
  QTableWidget* Matrix() { return window_->findChild<QTableWidget*>("overview.matrix"); }
  QTableWidget* Card() { return Child<QTableWidget>(window_.get(), "card.table"); }

  QTemporaryDir site_;
  std::unique_ptr<MainWindow> window_;
};

TEST_F(TwoRunsTest, HaveAColumnEachAndARefusalSaysWhy) {
  ASSERT_EQ(Matrix()->columnCount(), 2);
  EXPECT_EQ(Matrix()->horizontalHeaderItem(1)->text(), "run2");
  EXPECT_THAT(Matrix()->item(0, 1)->text().toStdString(), StartsWith("0.300\n"));
  const QStringList refused = Matrix()->item(1, 1)->text().split('\n');
  ASSERT_EQ(refused.size(), 2);
  EXPECT_EQ(refused[0], "refused");
  EXPECT_THAT(refused[1].toStdString(), StartsWith("only 12 of"));
  EXPECT_TRUE(refused[1].endsWith(QChar(0x2026)));  // elided
  EXPECT_THAT(Matrix()->item(1, 1)->toolTip().toStdString(), HasSubstr("only 12 of 20 matches agree on one pose"));
  EXPECT_EQ(Matrix()->item(2, 1)->text(), "no match\nno matches");
  EXPECT_EQ(Matrix()->item(3, 1), nullptr);
  Screenshot(window_.get(), "overview_two_runs");
  // A cell is of a run, which belongs to the selection.
  Matrix()->setCurrentCell(0, 1);
  EXPECT_EQ(window_->workspace()->selected(), "station:S0");
  EXPECT_EQ(window_->workspace()->run(), "run2");
  window_->workspace()->Select("station:S1", "run1");
  EXPECT_EQ(Matrix()->currentColumn(), 0);
  window_->workspace()->Select("station:S1", "run2");
  EXPECT_EQ(Matrix()->currentColumn(), 1);
}

// More answers are compared with the tag map, but those share evidence with it.
TEST_F(TwoRunsTest, MatrixSceneAndPlanAreOfOneComparison) {
  const std::filesystem::path dir = site_.path().toStdString(), file = dir / "results/evaluate/errors.csv";
  std::istringstream lines(ReadTextFile(file));
  std::string table;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("#")) line += line.starts_with("run,") ? ",shares_evidence" : ",no";
    table += line + "\n";
  }
  for (const char* run : {"run1", "run2"}) {
    for (const char* station : {"0", "1", "2", "3"}) {
      table += std::string(run) + ",,single,S" + station + ",panoramas/p00" + station + ".jpg," + station +
               ",survey,absolute,localized,,0.7,0.7,0,0.7,0,0,,0.05,0.05,0.08,1,3,yes\n";
    }
  }
  WriteFileAtomically(file, table);
  const SceneModel scene = LoadScene(Project::Open(dir));
  EXPECT_EQ(scene.comparison, "absolute, against surveyed control");
  ASSERT_EQ(scene.errors.size(), 5U);  // four of run1, one of run2: the others have no answer that is compared
  for (const SceneError& e : scene.errors) EXPECT_EQ(e.reference, "control") << e.run << " " << e.station;
  Open();
  const Overview& overview = *window_->overview()->overview();
  EXPECT_EQ(overview.comparison, scene.comparison);
  EXPECT_THAT(overview.plan_caption, HasSubstr("absolute, against surveyed control"));
  for (const SceneError& e : scene.errors) {
    const auto same = std::find_if(overview.matrix.begin(), overview.matrix.end(),
                                   [&](const ErrorRecord& of) { return of.run == e.run && of.panorama == e.panorama; });
    ASSERT_NE(same, overview.matrix.end());
    EXPECT_NEAR(*same->error_3d_m, e.difference.norm(), 1e-6) << e.run << " " << e.station;
  }
}

TEST_F(TwoRunsTest, WithoutAReferenceTheAnswersAreShown) {
  std::filesystem::remove_all((site_.path() + "/results/evaluate").toStdString());
  Open();
  ASSERT_EQ(Matrix()->rowCount(), 4);
  ASSERT_EQ(Matrix()->columnCount(), 2);
  EXPECT_EQ(Matrix()->verticalHeaderItem(2)->text(), "panoramas/p002.jpg");
  EXPECT_EQ(Matrix()->item(2, 1)->text(), QString::fromUtf8("localized\n\xcf\x83 0.080"));
  QTest::mouseClick(Matrix()->viewport(), Qt::LeftButton, {}, Matrix()->visualItemRect(Matrix()->item(2, 0)).center());
  EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p002.jpg");
  window_->workspace()->Select("station:S1");
  EXPECT_EQ(Matrix()->currentRow(), 1);
  ASSERT_EQ(Card()->rowCount(), 2);
  EXPECT_THAT(Card()->item(0, 1)->text().toStdString(), HasSubstr("localized, \xcf\x83 0.080 m"));
  EXPECT_THAT(Child<QLabel>(window_.get(), "card.note")->text().toStdString(), HasSubstr("not compared yet"));
  QString all;
  for (const auto* label : window_->overview()->findChildren<QLabel*>()) all += label->text() + "\n";
  EXPECT_FALSE(all.contains("Provenance"));
  EXPECT_FALSE(all.contains("not georeferenced: \n")) << all.toStdString();
}

TEST_F(TwoRunsTest, TheCardListsBothAndTheViewsOnRequest) {
  window_->workspace()->Select("station:S2");
  QTableWidget* card = Card();
  ASSERT_EQ(card->rowCount(), 3);  // what is compared, and the runs
  EXPECT_EQ(card->item(1, 0)->text(), "run1");
  EXPECT_EQ(card->item(2, 0)->text(), "run2");
  EXPECT_EQ(card->item(2, 1)->text(), "no match: no matches");
  auto* views = Child<QCheckBox>(window_.get(), "card.views");
  ASSERT_TRUE(views->isVisible());
  views->setChecked(true);
  ASSERT_EQ(card->rowCount(), 5);
  EXPECT_THAT(card->item(3, 0)->text().toStdString(), HasSubstr("view (G1)"));
  EXPECT_EQ(card->item(4, 1)->text(), "0.500");
  views->setChecked(false);
  EXPECT_EQ(card->rowCount(), 3);
  window_->workspace()->Select("station:S1");  // no view of it is evaluated
  EXPECT_THAT(card->item(2, 1)->text().toStdString(), HasSubstr("only 12 of 20 matches agree"));
  EXPECT_LT(card->columnWidth(1), 80);  // why it was refused stands across
  EXPECT_FALSE(views->isVisible());
  // A right click on the table decides about the station, Enter shows its image.
  emit card->customContextMenuRequested(card->visualItemRect(card->item(1, 0)).center());
  QMenu* menu = Child<QMenu>(window_.get(), "object.menu");
  EXPECT_NE(menu->findChild<QMenu*>("exclude station:S1"), nullptr);
  menu->close();
  card->setFocus();
  card->setCurrentCell(1, 0);
  QTest::keyClick(card, Qt::Key_Return);
  EXPECT_EQ(window_->desk(), "images");
}

TEST_F(TwoRunsTest, EachPanoramaOfAStationHasARow) {
  const std::filesystem::path dir = site_.path().toStdString(), errors = dir / "results/evaluate/errors.csv";
  QDir().mkpath(site_.path() + "/photos/station_001");
  for (const char* name : {"/a.jpg", "/b.jpg"}) {
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(Qt::darkGreen);
    ASSERT_TRUE(photo.save(site_.path() + "/photos/station_001" + name));
  }
  WriteFileAtomically(
      errors, ReadTextFile(errors) +
                  "run1,,single,S1,station_001,1,control,absolute,unmatched,nothing alike,,,,,,,,,,,,\n"
                  "run2,,single,S1,station_001,1,control,absolute,localized,,0.4,0.4,0,0.4,0,0,,0.05,0.05,0.08,1,3\n");
  Open();
  ASSERT_EQ(Matrix()->rowCount(), 5);
  const char* titles[] = {"S0", "S1 p001.jpg", "S1 station_001", "S2", "S3"};
  for (int row = 0; row < 5; ++row) EXPECT_EQ(Matrix()->verticalHeaderItem(row)->text(), titles[row]);
  EXPECT_THAT(Matrix()->item(1, 0)->text().toStdString(), StartsWith("0.020\n"));
  EXPECT_THAT(Matrix()->item(1, 1)->text().toStdString(), StartsWith("refused\n"));
  EXPECT_EQ(Matrix()->item(2, 0)->text(), "no match\nnothing alike");
  EXPECT_THAT(Matrix()->item(2, 1)->text().toStdString(), StartsWith("0.400\n"));
  QTest::mouseClick(Matrix()->viewport(), Qt::LeftButton, {}, Matrix()->visualItemRect(Matrix()->item(2, 0)).center());
  EXPECT_EQ(window_->workspace()->selected(), "panorama:station_001");
  EXPECT_EQ(Matrix()->currentRow(), 2);
  window_->workspace()->Select("panorama:panoramas/p001.jpg");
  EXPECT_EQ(Matrix()->currentRow(), 1);
  bool found = false;  // what is to be looked at first names it
  for (auto* label : window_->overview()->findChildren<QLabel*>()) {
    if (!label->text().contains("Largest error: run2 at S1 station_001, 0.40 m absolute")) continue;
    found = true;
    emit label->linkActivated(label->text().section('"', 1, 1));
    break;
  }
  EXPECT_TRUE(found);
  EXPECT_EQ(window_->workspace()->selected(), "panorama:station_001");
  EXPECT_EQ(Matrix()->currentRow(), 2);
  // So does the card, without a wider column.
  QTableWidget* card = Card();
  const char* first[] = {"", "p001.jpg", "run1", "run2", "station_001", "run1", "run2"};
  ASSERT_EQ(card->rowCount(), 7);
  for (int row = 1; row < 7; ++row) EXPECT_EQ(card->item(row, 0)->text(), first[row]);
  EXPECT_EQ(card->item(5, 1)->text(), "no match: nothing alike");
  EXPECT_LT(card->columnWidth(0), 80);
  Screenshot(window_.get(), "overview_several_panoramas");
}

TEST_F(TwoRunsTest, WhatTheReviewExcludesIsSaid) {
  window_->workspace()->Select("station:S1");
  window_->decisions()->Decide("exclude", "station:S1", "was moved");
  ASSERT_TRUE(
      WaitFor([&] { return Matrix() != nullptr && Matrix()->verticalHeaderItem(1)->text() == "S1 (excluded)"; }));
  EXPECT_THAT(Matrix()->verticalHeaderItem(1)->toolTip().toStdString(),
              HasSubstr("S1: excluded by the review: was moved"));
  EXPECT_THAT(Matrix()->item(1, 0)->toolTip().toStdString(), HasSubstr("excluded by the review: was moved"));
  EXPECT_EQ(Matrix()->verticalHeaderItem(2)->text(), "S2");
  const auto* title = Child<QLabel>(window_.get(), "card.title");
  EXPECT_THAT(title->text().toStdString(), HasSubstr("excluded by the review: was moved"));
  window_->workspace()->Select("station:S2");
  EXPECT_THAT(title->text().toStdString(), Not(HasSubstr("excluded")));
}

TEST_F(TwoRunsTest, TheCardSaysThatGroundTruthIsMissing) {
  const std::filesystem::path dir = site_.path().toStdString();
  for (const char* name : {"results/evaluate", "stations.csv", "tags.yaml", "control_points.csv"}) {
    std::filesystem::remove_all(dir / name);
  }
  Open();
  window_->workspace()->Select("panorama:panoramas/p001.jpg");
  ASSERT_GT(Card()->rowCount(), 0);
  EXPECT_THAT(Child<QLabel>(window_.get(), "card.note")->text().toStdString(),
              AllOf(HasSubstr("ground truth is missing (stations.csv"), Not(HasSubstr("run evaluate"))));
}

TEST_F(TwoRunsTest, WarningsAreThoseOfTheResultsAndOfAllOutlyingGeotags) {
  auto* warnings = Child<QLabel>(window_.get(), "overview.warnings");
  const std::string text = warnings->text().toStdString();
  EXPECT_THAT(text, HasSubstr("localize/run1, localize/run2: few matches at dusk (2 times)"));
  EXPECT_THAT(text, HasSubstr("localize/run1: an own one<"));
  EXPECT_THAT(text, HasSubstr("Outlying geotag: panoramas/p001.jpg, 12.00 m horizontally from the answer of run1"));
  EXPECT_THAT(text, HasSubstr("Outlying geotag: panoramas/p003.jpg"));
  emit warnings->linkActivated("panorama:panoramas/p003.jpg");
  EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p003.jpg");
  EXPECT_EQ(Matrix()->currentRow(), 3);
}

TEST_F(TwoRunsTest, ManyWarningsAreShownOnRequest) {
  std::string many;
  for (int i = 10; i < 40; ++i) many += (many.empty() ? "" : ", ") + ("\"the " + std::to_string(i)) + "th\"";
  WriteFileAtomically((site_.path() + "/results/localize/run2/manifest.json").toStdString(),
                      R"({"schema": 1, "warnings": [)" + many + "]}\n");
  Open();
  auto* warnings = Child<QLabel>(window_.get(), "overview.warnings");
  EXPECT_THAT(warnings->text().toStdString(), Not(HasSubstr("the 39th")));
  emit warnings->linkActivated("do:warnings");
  EXPECT_THAT(warnings->text().toStdString(), AllOf(HasSubstr("the 39th"), Not(HasSubstr("do:warnings"))));
}

// Photos called by a number also belong to a station of the set's name, which no table has.
TEST_F(TwoRunsTest, TheStationThatTheResultsKnowIsShown) {
  const QString photos = site_.path() + "/photos/station_002";
  QDir().mkpath(photos);
  for (const char* name : {"/a.jpg", "/b.jpg"}) {
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(Qt::darkGreen);
    ASSERT_TRUE(photo.save(photos + name));
  }
  Open();
  ASSERT_EQ(window_->workspace()->snapshot()->Related("station:S2").count("station:station_002"), 1u);
  const QRect cell = Matrix()->visualItemRect(Matrix()->item(2, 0));
  QTest::mouseClick(Matrix()->viewport(), Qt::LeftButton, {}, cell.center());
  EXPECT_EQ(Matrix()->currentRow(), 2);
  EXPECT_EQ(Card()->rowCount(), 3);
  window_->workspace()->Select("panorama:station_002");
  EXPECT_EQ(Matrix()->currentRow(), 2);
  EXPECT_EQ(Card()->rowCount(), 3);
  // Whichever comes first by name.
  Overview overview;
  overview.stations = {"zone 2"};
  const std::set<std::string> related = {"panorama:station_002", "station:station_002", "station:zone 2", "tag:2"};
  EXPECT_EQ(StationShown(&overview, related, "panorama:station_002"), "station:zone 2");
  EXPECT_EQ(StationShown(&overview, related, "station:station_002"), "station:zone 2");
  EXPECT_EQ(StationShown(nullptr, related, "station:zone 2"), "station:zone 2");
  EXPECT_EQ(StationShown(nullptr, {"panorama:p"}, "panorama:p"), "panorama:p");
  EXPECT_EQ(StationShown(nullptr, {"image:run1/a.jpg"}, "image:run1/a.jpg"), "");
}

}  // namespace
}  // namespace trigpoint
