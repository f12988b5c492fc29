// A whole session on a real site: run, cancel, run again, look, exclude, re-solve, undo, export, quit during a run.
//
// On the embedded site's shorter run, and on a stretch of lot_a where the shared data are. TRIGPOINT_GUI_SITE names
// another site instead of the first (a copy: results are written into it), and TRIGPOINT_GUI_RUN its run.
#include <gmock/gmock.h>

#include <QCheckBox>
#include <QComboBox>
#include <QElapsedTimer>
#include <QLabel>
#include <QPlainTextEdit>
#include <QProgressBar>
#include <QSettings>
#include <QSignalSpy>
#include <QTableView>
#include <QTableWidget>
#include <QTemporaryDir>
#include <algorithm>
#include <sstream>

#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/site_tree.h"
#include "app/desktop/tables_desk.h"
#include "datasets/io/text.h"
#include "datasets/project/lock.h"
#include "tests/eval/shared_data.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kLong = 1800000;  // ms, for a run
constexpr int kStretch = 40;    // images: 20 m

class SessionTest : public testing::Test {
 protected:
  void SetUp() override { QSettings().clear(); }
  void UseEmbeddedSite() {
    dir_ = qEnvironmentVariable("TRIGPOINT_GUI_SITE");
    run_ = qEnvironmentVariable("TRIGPOINT_GUI_RUN", "run2");
    if (!dir_.isEmpty()) return;
    dir_ = temporary_.filePath("site");
    fs::copy(fs::path(TRIGPOINT_SOURCE_DIR) / "datasets/parking_lot", dir_.toStdString(), fs::copy_options::recursive);
    for (const char* part : {"/runs/run1", "/photos"}) fs::remove_all(dir_.toStdString() + part);
  }
  // The first images of lot_a's first run and the panoramas it passes on them. Nothing is copied but what is shortened.
  void UseStretchOf(const fs::path& lot) {
    dir_ = temporary_.filePath("lot_a");
    run_ = "run1";
    const fs::path here = dir_.toStdString(), run = here / "runs/run1";
    fs::create_directories(run);
    fs::create_directories(here / "panoramas");
    for (const char* file : {"camchain.yaml", "gps.csv", "odometry.tum", "run.yaml", "images"}) {
      fs::create_symlink(lot / "runs/run1" / file, run / file);
    }
    for (const char* file : {"aerial.tif", "control_points.csv", "origin.json", "tags.yaml"}) {
      fs::create_symlink(lot / file, here / file);
    }
    for (const char* panorama : {"pano_057.jpg", "pano_110.jpg"}) {
      fs::create_symlink(lot / "panoramas" / panorama, here / "panoramas" / panorama);
    }
    const auto keep = [](const fs::path& from, const fs::path& to, const auto& wanted) {
      std::istringstream lines(ReadTextFile(from));
      std::string kept;
      int n = 0;
      for (std::string line; std::getline(lines, line); ++n) {
        if (wanted(line, n)) kept += line + "\n";
      }
      WriteFileAtomically(to, kept);
    };
    const auto of_both = [](const std::string& line, int n) {
      return n < 2 || line.find("S57,") != std::string::npos || line.find("S110,") != std::string::npos;
    };
    keep(lot / "runs/run1/images.txt", run / "images.txt", [](const std::string&, int n) { return n <= kStretch; });
    keep(lot / "panoramas.csv", here / "panoramas.csv", of_both);
    keep(lot / "stations.csv", here / "stations.csv", of_both);
  }
  void FromTheFirstRunToTheLastQuit();
  // Starts a stage from the form and waits for its end.
  JobController::End RunStage(const char* stage, bool cancel) {
    window_->ShowDesk("run");
    window_->run_desk()->Choose(stage, run_);
    QSignalSpy ended(window_->jobs(), &JobController::Finished);
    QSignalSpy progress(window_->jobs(), &JobController::Progress);
    ClickToRun(window_.get(), "run.run");
    EXPECT_TRUE(window_->jobs()->running());
    if (cancel) {
      EXPECT_TRUE(WaitFor([&] { return progress.count() > 5; }, kLong));
      QElapsedTimer timer;
      timer.start();
      Click(window_.get(), "run.cancel");
      EXPECT_TRUE(WaitFor([&] { return ended.count() == 1; }));
      std::printf("cancelled after %lld ms\n", static_cast<long long>(timer.elapsed()));
    } else {
      // A stage may be done before it has said much.
      EXPECT_TRUE(WaitFor([&] { return progress.count() > 5 || ended.count() == 1; }, kLong));
      Screenshot(window_.get(), QString("running_") + stage);
      EXPECT_TRUE(WaitFor([&] { return ended.count() == 1; }, kLong));
    }
    return ended.isEmpty() ? JobController::End::kFailed : ended[0][0].value<JobController::End>();
  }
  std::string Errors() const { return ReadTextFile(dir_.toStdString() + "/results/evaluate/errors.csv"); }

  QTemporaryDir temporary_;
  QString dir_, run_;
  std::unique_ptr<MainWindow> window_;
};

void SessionTest::FromTheFirstRunToTheLastQuit() {
  window_ = OpenWindow(dir_);
  ASSERT_EQ(RunStage("localize", true), JobController::End::kCancelled);
  EXPECT_THAT(Child<QLabel>(window_.get(), "run.status")->text().toStdString(), HasSubstr("Cancelled"));
  ASSERT_EQ(RunStage("localize", false), JobController::End::kDone);
  EXPECT_TRUE(WaitFor([&] { return window_->tree()->StateOf("localize/" + run_) == "done"; }, kLong));
  ASSERT_EQ(RunStage("evaluate", false), JobController::End::kDone);

  // A station of the table in the scene.
  window_->ShowDesk("scene");
  ASSERT_TRUE(WaitFor([&] { return window_->scene()->HasScene(); }));
  window_->ShowDesk("tables");
  ASSERT_TRUE(WaitFor([&] { return window_->tables()->Choose("evaluate/errors"); }));
  auto* view = Child<QTableView>(window_.get(), "tables.view");
  Type(window_.get(), "tables.filter", "localized");
  ASSERT_TRUE(WaitFor([&] { return view->model()->rowCount() > 0; }));
  ClickRow(view, 0);
  const QString station = window_->workspace()->selected();
  ASSERT_TRUE(station.startsWith("station:")) << station.toStdString();
  EXPECT_TRUE(window_->scene()->Highlighted().contains(station));
  Screenshot(window_.get(), "session_tables");
  window_->ShowDesk("scene");
  Screenshot(window_.get(), "session_scene");
  const QTemporaryDir out;
  window_->tables()->Export(out.filePath("errors.csv"));
  EXPECT_THAT(ReadTextFile(out.filePath("errors.csv").toStdString()), HasSubstr("error_3d_m"));
  EXPECT_TRUE(window_->scene()->Screenshot(800, 450).save(out.filePath("scene.png")));

  // The best image of its tag; the detection in it is excluded.
  window_->ShowDesk("images");
  ASSERT_TRUE(window_->images()->ShowObject(station));
  PictureView* picture = window_->images()->left();
  QString detection;
  const auto on_the_tag = [&] {
    for (const PictureMark& mark : picture->marks()) {
      const auto in_sight = [&](const QPointF& corner) {
        return QRectF(picture->rect()).contains(picture->WidgetAt(corner));
      };
      const bool seen = std::all_of(mark.points.begin(), mark.points.end(), in_sight);
      if (mark.layer == "detections" && seen && picture->scale() > 1.5) detection = mark.object;
    }
    return !detection.isEmpty();
  };
  // However small the panes are, and when they have been placed anew.
  for (const QSize& size : {QSize(1024, 700), QSize(1280, 800)}) {
    detection.clear();
    window_->resize(size);
    ASSERT_TRUE(WaitFor([&] { return window_->size() == size && !window_->images()->right()->image().isNull(); }));
    ASSERT_TRUE(WaitFor(on_the_tag)) << station.toStdString() << ": scale " << picture->scale();
    Screenshot(window_.get(), QString("session_images_%1").arg(size.width()));
  }
  const QString panorama = Child<QComboBox>(window_.get(), "images.reference")->currentText();
  Click(window_.get(), "images.match");
  EXPECT_TRUE(WaitFor([&] { return !window_->images()->right()->marks().empty(); }, kLong)) << panorama.toStdString();
  picture->Fit();
  Screenshot(window_.get(), "session_matches");

  const std::string before = Errors();
  window_->ShowDesk("review");
  window_->workspace()->Select(detection);
  QSignalSpy reviewed(window_->review(), &ReviewDesk::Reviewed), solved(window_->review(), &ReviewDesk::Solved);
  Type(window_.get(), "review.reason", "half hidden");
  Click(window_.get(), "review.exclude");
  ASSERT_TRUE(WaitFor([&] { return reviewed.count() == 1; }));
  EXPECT_EQ(window_->workspace()->selected(), detection);  // over the reload, too
  ClickToRun(window_.get(), "review.solve");
  ASSERT_TRUE(WaitFor([&] { return solved.count() == 1; }, kLong));
  EXPECT_NE(Errors(), before);
  Child<QCheckBox>(window_.get(), "review.small")->setChecked(true);
  EXPECT_GT(Child<QTableWidget>(window_.get(), "review.changes")->rowCount(), 0);
  Screenshot(window_.get(), "session_review");
  ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); }));
  QSignalSpy job_ended(window_->jobs(), &JobController::JobEnded);
  Click(window_.get(), "review.undo");
  ASSERT_TRUE(WaitFor([&] { return reviewed.count() == 2; }));
  ASSERT_TRUE(WaitFor([&] { return solved.count() == 2; }, kLong));  // by itself
  for (const QList<QVariant>& end : job_ended) {  // the kept ones are taken: evaluate is not computed again
    if (end[0].toString() == "evaluate") {
      EXPECT_EQ(end[1].toString(), "up to date");
    }
  }
  EXPECT_EQ(Errors(), before);  // as if nothing had been
  EXPECT_EQ(std::count(before.begin(), before.end(), '\n') > 2, true);

  // Quit during a run: the window goes at once when the worker has, and nothing half-made is taken for a result.
  window_->ShowDesk("run");
  window_->run_desk()->Choose("localize", run_);
  Child<QComboBox>(window_.get(), "run.variant")->setCurrentText("trial");
  QSignalSpy progress(window_->jobs(), &JobController::Progress);
  ClickToRun(window_.get(), "run.run");
  ASSERT_TRUE(WaitFor([&] { return progress.count() > 5; }, kLong));
  window_->close();
  EXPECT_TRUE(WaitFor([&] { return !window_->isVisible(); }));
  EXPECT_FALSE(window_->jobs()->running());
  window_.reset();
  EXPECT_FALSE(fs::exists(dir_.toStdString() + "/results/localize/" + run_.toStdString() + "@trial"));
  EXPECT_FALSE(ProjectLock::Holder(dir_.toStdString() + "/results").has_value());
  EXPECT_EQ(Errors(), before);
}

TEST_F(SessionTest, EmbeddedSiteFromTheFirstRunToTheLastQuit) {
  UseEmbeddedSite();
  FromTheFirstRunToTheLastQuit();
}

TEST_F(SessionTest, LotFromTheFirstRunToTheLastQuit) {
  // Only where it is asked for: it takes minutes, as every run of a stage takes its time.
  if (std::getenv("TRIGPOINT_SHARED_DATA") == nullptr) GTEST_SKIP() << "TRIGPOINT_SHARED_DATA is not set";
  const std::optional<fs::path> lot = SharedData("lot_a");
  if (!lot) GTEST_SKIP() << "lot_a is not there";
  UseStretchOf(fs::absolute(*lot));
  FromTheFirstRunToTheLastQuit();
}

}  // namespace
}  // namespace trigpoint
