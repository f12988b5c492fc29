// The desk that checks a folder while pictures are copied into it.
#include "eval/intake/check.h"

#include <gmock/gmock.h>

#include <QLabel>
#include <QListWidget>
#include <QPushButton>
#include <QSignalSpy>
#include <QTableWidget>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "app/desktop/check_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/site_tree.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

class CheckDeskTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    // What was written just now may still be being copied: the pictures are older.
    for (const auto& entry : fs::recursive_directory_iterator(Path("runs").toStdString())) {
      if (entry.is_regular_file()) fs::last_write_time(entry, fs::file_time_type::clock::now() - std::chrono::hours(1));
    }
    ResultsWindowTest::SetUp();
  }
};

// On the map the mark of what belongs to the selection, since a map has tags and no stations.
TEST_F(CheckDeskTest, TheMapMarksWhatBelongsToTheSelection) {
  window_->ShowDesk("check");
  PictureView* map = window_->check()->map();
  QImage paper(200, 200, QImage::Format_RGB32);
  paper.fill(Qt::white);
  map->SetPicture(paper, "");
  PictureMark mark;  // it is seen only when it is marked
  mark.kind = PictureMark::Kind::kCircle;
  mark.points << QPointF(100, 100) << QPointF(20, 0);
  mark.colour = QColor(0, 0, 0, 0);
  mark.object = "tag:2";
  map->SetMarks({mark});
  const QImage before = map->grab().toImage();
  window_->workspace()->Select("station:S2");
  EXPECT_NE(map->grab().toImage(), before);
}

TEST_F(CheckDeskTest, ShowsWhatTheCommandFindsAndWatchesUntilStopped) {
  window_->ShowDesk("check");
  CheckDesk* desk = window_->check();
  EXPECT_EQ(desk->outcome(), nullptr);
  EXPECT_FALSE(Child<QPushButton>(window_.get(), "check.stop")->isEnabled());
  Screenshot(window_.get(), "check_empty");
  QSignalSpy judged(desk, &CheckDesk::Judged), ended(desk, &CheckDesk::Ended);
  Click(window_.get(), "check.check");
  EXPECT_TRUE(desk->running());
  ASSERT_TRUE(WaitFor([&] { return ended.count() == 1; })) << desk->running();
  ASSERT_NE(desk->outcome(), nullptr) << Child<QLabel>(window_.get(), "check.status")->text().toStdString();
  EXPECT_GT(desk->outcome()->pictures, 0);
  EXPECT_EQ(Child<QLabel>(window_.get(), "check.headline")->text().toStdString(), CheckHeadline(*desk->outcome()));
  const auto* findings = Child<QTableWidget>(window_.get(), "check.findings");
  ASSERT_EQ(findings->rowCount(), static_cast<int>(desk->outcome()->findings.size()));
  for (int row = 0; row < findings->rowCount(); ++row) {
    EXPECT_EQ(findings->item(row, 2)->text().toStdString(),
              desk->outcome()->findings[static_cast<size_t>(row)].text.In());
  }
  // What was said in metres is said in feet without another look.
  window_->workspace()->SetUnit("ft");
  const auto in_feet = [](const LengthText& text) { return text.In("ft", 0.3048); };
  for (int row = 0; row < findings->rowCount(); ++row) {
    EXPECT_EQ(findings->item(row, 2)->text().toStdString(),
              in_feet(desk->outcome()->findings[static_cast<size_t>(row)].text));
  }
  const auto* next = Child<QTableWidget>(window_.get(), "check.next");
  ASSERT_EQ(next->rowCount(), static_cast<int>(desk->outcome()->advice.size()));
  for (int row = 0; row < next->rowCount(); ++row) {
    EXPECT_EQ(next->item(row, 0)->text().toStdString(),
              in_feet(desk->outcome()->advice[static_cast<size_t>(row)].what));
  }
  EXPECT_THAT(next->item(0, 0)->text().toStdString(), testing::HasSubstr("from 10 to 16 ft"));
  window_->workspace()->SetUnit("m");
  EXPECT_TRUE(fs::exists(Path("results/check/index.html").toStdString()));
  auto* tags = Child<QTableWidget>(window_.get(), "check.tags");
  ASSERT_GT(tags->rowCount(), 0);
  ClickRow(tags, 0);
  EXPECT_EQ(window_->workspace()->selected(), "tag:" + tags->item(0, 0)->text());
  Screenshot(window_.get(), "check");

  // Watched, a picture more is seen.
  const int before = desk->outcome()->pictures;
  Click(window_.get(), "check.watch");
  ASSERT_TRUE(WaitFor([&] { return judged.count() >= 2; }));
  const fs::path run = Path("runs/run1").toStdString();
  std::string last;
  std::ifstream list(run / "images.txt");
  for (std::string line; std::getline(list, line);) last = line.empty() || line[0] == '#' ? last : line;
  list.close();
  const std::string file = last.substr(last.rfind(' ') + 1);
  fs::copy_file(run / file, run / "images" / "added.jpg");
  std::ofstream(run / "images.txt", std::ios::app) << "99.0 images/added.jpg\n";
  EXPECT_TRUE(WaitFor([&] { return desk->outcome()->pictures == before + 1; }))
      << desk->outcome()->pictures << " after " << last;
  // The other desks have it, too.
  EXPECT_TRUE(WaitFor([&] {
    return !window_->tree()->findItems("images/added.jpg", Qt::MatchExactly | Qt::MatchRecursive).isEmpty() &&
           !Child<QListWidget>(window_.get(), "images.list")->findItems("images/added.jpg", Qt::MatchExactly).isEmpty();
  }));
  Click(window_.get(), "check.stop");
  ASSERT_TRUE(WaitFor([&] { return !desk->running(); }));
  EXPECT_EQ(ended.count(), 2);
  Screenshot(window_.get(), "check_stopped");
}

}  // namespace
}  // namespace trigpoint
