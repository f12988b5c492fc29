// The run desk and the review: what is run, how long it takes, what is shown of it meanwhile and afterwards.
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QLabel>
#include <QMessageBox>
#include <QPlainTextEdit>
#include <QSignalSpy>
#include <QSpinBox>
#include <QTabWidget>
#include <QTableWidget>
#include <QTranslator>

#include "app/desktop/review_desk.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/snapshot.h"
#include "app/desktop/stage_graph.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

class RunTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    window_->ShowDesk("run");
    results_ = Child<QTableWidget>(window_.get(), "run.results");
    graph_ = Child<StageGraph>(window_.get(), "run.graph");
  }
  void TearDown() override {
    WaitFor([&] { return !window_->jobs()->running() && !window_->workspace()->opening(); });
    window_.reset();
    for (const char* file : {"results/detect/run1/manifest.json", "trigpoint.yaml"}) QFile::remove(Path(file));
  }
  // A result that took an hour, and whose inputs are others now.
  void WriteLongResult() {
    WriteFileAtomically(Path("results/detect/run1/manifest.json").toStdString(),
                        R"({"schema": 1, "stage": "detect", "name": "run1", "identity": "of other inputs",
                            "wall_seconds": 3600.0, "metrics": {"detections": 8}})");
  }
  void ReadLongResult() {
    WriteLongResult();
    window_->workspace()->Reload();
    ASSERT_TRUE(WaitFor([&] { return StateOf("detect/run1") == "out of date"; }));
  }
  std::string StateOf(const QString& result) const {
    const int row = RowWith(results_, result);
    return row < 0 ? "" : results_->item(row, 1)->text().toStdString();
  }
  const StageBox* Box(const std::string& stage) const {
    for (const StageBox& box : graph_->boxes()) {
      if (box.stage == stage) return &box;
    }
    return nullptr;
  }
  QString Text(const char* label) { return Child<QLabel>(window_.get(), label)->text(); }
  QMessageBox* Ask() { return window_->findChild<QMessageBox*>("run.ask"); }
  void Answer(QMessageBox::StandardButton button) {
    ASSERT_NE(Ask(), nullptr);
    Ask()->button(button)->click();
    ASSERT_TRUE(WaitFor([&] { return Ask() == nullptr; }));
  }
  // What the status says while a stage is run, until its end or, with `cancel`, its first word.
  std::vector<std::string> Said(const char* stage, bool cancel) {
    std::vector<std::string> said;
    window_->run_desk()->Choose(stage, "");
    QSignalSpy ended(window_->jobs(), &JobController::Finished);
    const auto listening = QObject::connect(window_->jobs(), &JobController::Progress, window_.get(), [&] {
      said.push_back(Text("run.status").toStdString());
      if (cancel) window_->jobs()->Cancel();
    });
    Click(window_.get(), "run.run");
    Answer(QMessageBox::Yes);
    EXPECT_TRUE(WaitFor([&] { return ended.count() == 1; }));
    QObject::disconnect(listening);
    return said;
  }

  QTableWidget* results_ = nullptr;
  StageGraph* graph_ = nullptr;
};

TEST_F(RunTest, ACalibrationsNameIsNoVariant) {
  auto* variant = Child<QComboBox>(window_.get(), "run.variant");
  window_->run_desk()->Choose("calibrate", "");
  variant->setCurrentText("phone");
  window_->run_desk()->Choose("calibrate", "");  // as the window's other buttons do
  EXPECT_EQ(variant->currentText(), "phone");
  emit graph_->Chosen("localize");
  EXPECT_EQ(Child<QComboBox>(window_.get(), "run.stage")->currentData().toString(), "localize");
  EXPECT_EQ(variant->currentText(), "");
}

TEST_F(RunTest, AllIsWhatStatusAdvises) {
  window_->run_desk()->Choose("localize", "run1", "trial");
  EXPECT_EQ(Child<QComboBox>(window_.get(), "run.variant")->currentText(), "trial");
  Child<QSpinBox>(window_.get(), "run.seed")->setValue(7);  // all would be made anew
  QStringList commands;
  QObject::connect(window_->jobs(), &JobController::Started, window_.get(), [&](const QString& command) {
    commands << command;
    window_->jobs()->Cancel();
  });
  QSignalSpy ended(window_->jobs(), &JobController::Finished);
  MenuAction("Run all that is out of date")->trigger();
  ASSERT_TRUE(WaitFor([&] { return ended.count() == 1; }));
  EXPECT_EQ(commands, QStringList("trigpoint run " + site_->path()));
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "run.command")->text(), commands.value(0));
}

TEST_F(RunTest, TimeLeftOfAllIsSaidAndForgottenAtTheEnd) {
  ReadLongResult();
  // Others were never made: no more than a lower bound is known.
  EXPECT_THAT(Said("survey", true), Contains(HasSubstr("of all at least")));
  ReadLongResult();
  EXPECT_THAT(Said("detect", false), Contains(HasSubstr("of all about")));
  emit window_->jobs()->Progress("survey", "of another desk", 1, 2, 5);
  EXPECT_THAT(Text("run.status").toStdString(), Not(HasSubstr("of all")));
}

TEST_F(RunTest, StatesAndEditsFollowARun) {
  ReadLongResult();
  ASSERT_NE(Box("detect"), nullptr);
  EXPECT_EQ(Box("detect")->state, "out of date");
  std::vector<std::string> drawn, listed;
  QObject::connect(window_->workspace(), &Workspace::StateChanged, window_.get(), [&] {
    drawn.push_back(Box("detect")->state);
    listed.push_back(StateOf("detect/run1"));
  });
  window_->run_desk()->Choose("detect", "");
  Type(window_.get(), "option.min_margin", "40.5");
  QSignalSpy ended(window_->jobs(), &JobController::Finished);
  Click(window_.get(), "run.run");
  Answer(QMessageBox::Yes);
  const auto before = window_->workspace()->snapshot();
  ASSERT_TRUE(WaitFor([&] { return ended.count() == 1 && window_->workspace()->snapshot() != before; }));
  EXPECT_THAT(drawn, Contains("running"));
  EXPECT_THAT(drawn, Contains("done"));
  EXPECT_EQ(listed, drawn);
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "option.min_margin")->text(), "40.5");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("--set min_margin=40.5"));
}

TEST_F(RunTest, AJobIsOfTheProjectThatItWasStartedIn) {
  ReadLongResult();
  Said("detect", true);
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  window_->OpenProject(other.path());
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == other.path(); }));
  ASSERT_TRUE(WaitFor([&] { return !StateOf("features/run1").empty(); }));
  emit window_->jobs()->JobBegan("features/run1");
  emit window_->jobs()->Progress("features/run1", "reading", 1, 2, 5);
  const std::string first = QDir(site_->path()).dirName().toStdString();
  EXPECT_THAT(Text("run.status").toStdString(), HasSubstr(first + ": features/run1: reading, 1 of 2"));
  EXPECT_THAT(Text("progress").toStdString(), HasSubstr(first + ": features/run1: reading, 50 %"));
  EXPECT_EQ(StateOf("features/run1"), "missing");
  EXPECT_EQ(Box("features")->state, "missing");
}

TEST_F(RunTest, AnEndIsOfTheProjectThatItWasStartedIn) {
  ReadLongResult();
  Said("detect", true);
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  window_->OpenProject(other.path());
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == other.path(); }));
  emit window_->jobs()->JobEnded("detect/run1", "failed", "no image can be read");
  emit window_->jobs()->Finished(JobController::End::kFailed, "no image can be read");
  const std::string whose = "Project " + QDir(site_->path()).dirName().toStdString() + ": ";
  EXPECT_THAT(window_->problem()->sentence().toStdString(), testing::StartsWith(whose));
  EXPECT_THAT(Text("run.status").toStdString(), testing::StartsWith(whose));
  EXPECT_THAT(Child<QPlainTextEdit>(window_.get(), "run.log")->toPlainText().toStdString(),
              HasSubstr(whose + "detect/run1: failed: no image"));
  ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); }));
}

TEST_F(RunTest, OneIsAskedBeforeAnotherSeedMakesAllAnew) {
  WriteFileAtomically(Path("results/detect/run1/manifest.json").toStdString(),
                      R"({"schema": 1, "stage": "detect", "name": "run1", "identity": "of other inputs", "seed": 1,
                          "wall_seconds": 3600.0, "metrics": {"detections": 8}})");
  window_->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return StateOf("detect/run1") == "out of date"; }));
  window_->workspace()->SetState("detect/run1", "done");
  window_->run_desk()->Choose("detect", "");
  JobQuery query;
  query.stages = {"detect"};
  const auto again = [&](uint64_t seed) {
    return ExpectedTimeOf(*window_->workspace()->snapshot(), window_->workspace()->results(), query, seed).again;
  };
  EXPECT_EQ(again(1), 0);
  EXPECT_EQ(again(7), 1);
  EXPECT_FALSE(Child<QLabel>(window_.get(), "run.expected")->isVisible());
  Child<QSpinBox>(window_.get(), "run.seed")->setValue(7);
  EXPECT_THAT(Text("run.expected").toStdString(), HasSubstr("1:00:00"));
  Click(window_.get(), "run.run");
  Answer(QMessageBox::No);
  EXPECT_FALSE(window_->jobs()->running());
}

TEST_F(RunTest, EditsOfAStageOutlastAnother) {
  window_->run_desk()->Choose("detect", "");
  Type(window_.get(), "option.min_margin", "40.5");
  window_->run_desk()->Choose("localize", "");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), Not(HasSubstr("min_margin")));
  window_->run_desk()->Choose("detect", "");
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "option.min_margin")->text(), "40.5");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("--set min_margin=40.5"));
}

TEST_F(RunTest, StatesAreInTheLanguageOfTheTree) {
  class Translator : public QTranslator {
   public:
    QString translate(const char* context, const char* text, const char*, int) const override {
      return QString(context) == "trigpoint::SiteTree" && QString(text) == "missing" ? "fehlt" : QString();
    }
    bool isEmpty() const override { return false; }
  } translator;
  QApplication::installTranslator(&translator);
  window_->workspace()->Reload();
  EXPECT_TRUE(WaitFor([&] { return StateOf("features/run1") == "fehlt"; }, 20000)) << StateOf("features/run1");
  EXPECT_THAT(graph_->accessibleDescription().toStdString(), HasSubstr("fehlt"));
  QApplication::removeTranslator(&translator);
}

TEST_F(RunTest, ControlsAndColumnsSayWhatTheyMean) {
  for (const char* name : {"run.stage", "run.threads", "run.seed", "run.runs"}) {
    EXPECT_FALSE(Child<QWidget>(window_.get(), name)->toolTip().isEmpty()) << name;
  }
  for (int c = 0; c < results_->columnCount(); ++c) {
    EXPECT_FALSE(results_->horizontalHeaderItem(c)->toolTip().isEmpty()) << c;
  }
}

TEST_F(RunTest, TheGraphShowsMetricsAndFitsItsWindow) {
  ReadLongResult();
  EXPECT_EQ(Box("detect")->metric.Text({}), "detections 8");
  for (size_t b = 0; b < graph_->boxes().size(); ++b) {
    EXPECT_TRUE(graph_->visibleRegion().boundingRect().contains(graph_->RectOf(b).toAlignedRect()))
        << graph_->boxes()[b].stage;
  }
  Screenshot(window_.get(), "run_metrics");
  // It is drawn.
  std::vector<StageBox> boxes = graph_->boxes();
  const QImage with = graph_->grab().toImage();
  for (StageBox& box : boxes) box.metric = {};
  graph_->Show(boxes);
  EXPECT_NE(graph_->grab().toImage(), with);
}

TEST_F(RunTest, InASmallWindowNoStageIsBeyondTheGraphsRightEdge) {
  window_->resize(1024, 700);
  ASSERT_TRUE(WaitFor([&] { return window_->width() == 1024; }));
  const auto seen = [this] {
    for (size_t b = 0; b < graph_->boxes().size(); ++b) {
      if (graph_->RectOf(b).right() > graph_->parentWidget()->width()) return false;
    }
    return true;
  };
  EXPECT_TRUE(WaitFor(seen, 2000)) << graph_->parentWidget()->width();
  const std::vector<StageBox>& boxes = graph_->boxes();
  for (size_t b = 0; b < boxes.size(); ++b) {
    for (const size_t a : boxes[b].needs) EXPECT_LT(graph_->RectOf(a).bottom(), graph_->RectOf(b).top());
    for (size_t a = 0; a < b; ++a) EXPECT_FALSE(graph_->RectOf(a).intersects(graph_->RectOf(b)));
  }
  Screenshot(window_.get(), "small_run_graph");
}

TEST_F(RunTest, OfSeveralResultsCountsAreAddedAndTheLargestErrorIsTaken) {
  std::vector<SnapshotResult> results;
  const auto add = [&](const char* stage, const char* run, const char* variant, StageMetric metric) {
    SnapshotResult result;
    result.stage = stage, result.run = run, result.variant = variant, result.metric = std::move(metric),
    result.state = "done";
    results.push_back(result);
  };
  using Kind = StageMetric::Kind;
  add("detect", "run1", "", {Kind::kCount, "detections", 12, ""});
  add("detect", "run2", "", {Kind::kCount, "detections", 30, ""});
  add("localize", "run1", "", {Kind::kCount, "localized", 3, ""});
  add("localize", "run1", "trial", {Kind::kCount, "localized", 4, ""});  // another answer to the same
  add("evaluate", "run1", "", {Kind::kLength, "median", 0.3, ""});
  add("evaluate", "run2", "", {Kind::kLength, "median", 0.5, ""});
  graph_->Show(StageBoxesOf(*window_->workspace()->snapshot()->project, results));
  EXPECT_EQ(Box("detect")->metric.Text({}), "detections 42");
  EXPECT_EQ(Box("localize")->metric.Text({}), "localized 3");
  EXPECT_EQ(Box("evaluate")->metric.Text({}), "median 0.500 m");
  EXPECT_EQ(Box("evaluate")->metric.Text({"ft", 0.3048}), "median 1.640 ft");
  EXPECT_THAT(graph_->accessibleDescription().toStdString(), HasSubstr("detections 42 in all"));
  EXPECT_THAT(graph_->accessibleDescription().toStdString(), HasSubstr("median 0.500 m at most"));
}

TEST_F(RunTest, ReturnChoosesTheResultOfARow) {
  Child<QTabWidget>(window_.get(), "run.states")->setCurrentWidget(results_);
  const int row = RowWith(results_, "localize/run1@trial");
  ASSERT_GE(row, 0);
  results_->setCurrentCell(row, 0);
  QTest::keyClick(results_, Qt::Key_Return);
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "run.command")->text(),
            "trigpoint localize " + site_->path() + " --variant trial");
}

TEST_F(RunTest, OneIsAskedBeforeALongReSolve) {
  window_->ShowDesk("review");
  WriteLongResult();
  // At once, when the states are not known yet.
  bool asked = false;
  const auto opened = QObject::connect(window_->workspace(), &Workspace::Opened, window_.get(), [&] {
    window_->review()->Solve();
    asked = Ask() != nullptr && Ask()->text().contains("not known yet");
  });
  window_->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return asked; }));
  QObject::disconnect(opened);
  EXPECT_THAT(Ask()->text().toStdString(), HasSubstr("1:00:00"));
  Answer(QMessageBox::No);
  EXPECT_FALSE(window_->jobs()->running());
  ASSERT_TRUE(WaitFor([&] { return StateOf("detect/run1") == "out of date"; }));
  Click(window_.get(), "review.solve");
  ASSERT_NE(Ask(), nullptr);
  EXPECT_THAT(Ask()->text().toStdString(), HasSubstr("Results that are computed again"));
  Answer(QMessageBox::No);
  EXPECT_FALSE(window_->jobs()->running());
}

TEST_F(RunTest, AReSolveSaysWhatHappened) {
  window_->ShowDesk("review");
  ASSERT_TRUE(WaitFor([&] { return !StateOf("features/run1").empty(); }));
  WriteFileAtomically(Path("trigpoint.yaml").toStdString(), "stages: {detect: {nonsense: 1}}\n");  // nothing runs
  Click(window_.get(), "review.solve");
  ASSERT_TRUE(WaitFor([&] { return !window_->jobs()->running(); }));
  EXPECT_THAT(Text("review.summary").toStdString(), HasSubstr("Failed: "));
  EXPECT_THAT(Text("review.summary").toStdString(), HasSubstr("nonsense"));
  EXPECT_THAT(Text("review.summary").toStdString(), Not(HasSubstr("Nothing changed")));
  // Without an earlier evaluation.
  ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); }));
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  QDir(other.filePath("results/evaluate")).removeRecursively();
  WriteFileAtomically(other.filePath("trigpoint.yaml").toStdString(), "name: other\n");
  window_->OpenProject(other.path());
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == other.path(); }));
  WriteFileAtomically(other.filePath("trigpoint.yaml").toStdString(), "stages: {detect: {nonsense: 1}}\n");
  Click(window_.get(), "review.solve");
  emit window_->jobs()->Finished(JobController::End::kDone, "");  // as if it had gone well
  EXPECT_THAT(Text("review.summary").toStdString(), HasSubstr("no evaluation before"));
  EXPECT_EQ(Child<QTableWidget>(window_.get(), "review.changes")->rowCount(), 0);
  ASSERT_TRUE(WaitFor([&] { return !window_->jobs()->running() && !window_->workspace()->opening(); }));
}

}  // namespace
}  // namespace trigpoint
