// What is selected on one desk is on all; decisions from context menus, undone and made again.
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QImage>
#include <QLabel>
#include <QLineEdit>
#include <QMenu>
#include <QSignalSpy>
#include <QSlider>
#include <QTableView>
#include <QTableWidget>
#include <QTreeWidget>

#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/site_tree.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class SelectionTest : public ResultsWindowTest {
 protected:
  void TearDown() override { QFile::remove(Path("review.jsonl")); }
  QMenu* OpenedMenu() {
    for (QMenu* menu : window_->findChildren<QMenu*>("object.menu")) {
      if (menu->isVisible()) return menu;
    }
    return nullptr;
  }
  // "exclude station:S2" of the menu that is open.
  QMenu* Reasons(const char* name) {
    QMenu* menu = OpenedMenu();
    return menu == nullptr ? nullptr : menu->findChild<QMenu*>(name);
  }
  bool Excluded(const char* object) const { return window_->workspace()->snapshot()->excluded.count(object) > 0; }
};

TEST_F(SelectionTest, ATableThatIsOnlyLookedAtSelectsNothing) {
  ShowErrors();
  window_->ShowDesk("images");
  window_->workspace()->Select("image:run1/images/000004.jpg");  // has no row in the table
  window_->ShowDesk("tables");
  view_->setFocus();
  ASSERT_TRUE(WaitFor([&] { return view_->hasFocus(); }));
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000004.jpg");
}

TEST_F(SelectionTest, ARowIsSelectedAgainByAClick) {
  ShowErrors();
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  window_->workspace()->Select("image:run1/images/000004.jpg");  // has no row here
  EXPECT_TRUE(view_->selectionModel()->selectedRows().isEmpty());
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
}

TEST_F(SelectionTest, EveryDeskFollows) {
  ShowScene();
  auto* panoramas = Child<QComboBox>(window_.get(), "panorama.set");
  auto* compared = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return compared->rowCount() == 4; }));
  window_->ShowDesk("images");
  window_->workspace()->Select("station:S2");
  EXPECT_THAT(panoramas->currentText().toStdString(), HasSubstr("panoramas/p002.jpg"));
  EXPECT_EQ(Child<QComboBox>(window_.get(), "images.reference")->currentText(), "panoramas/p002.jpg");
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "review.object")->text(), "station:S2");
  ASSERT_FALSE(compared->selectedItems().isEmpty());
  EXPECT_EQ(compared->selectedItems().front()->data(Qt::UserRole).toString(), "station:S2");
  // The images desk goes to the image that sees the station's tag; the scene's slider to the nearest camera.
  EXPECT_TRUE(WaitFor([&] {
    for (const PictureMark& mark : window_->images()->left()->marks()) {
      if (mark.object.startsWith("detection:") && mark.object.endsWith("#2")) return true;
    }
    return false;
  }));
  auto* time = Child<QSlider>(window_.get(), "scene.time");
  const int near_s2 = time->value();
  window_->workspace()->Select("tag:0");
  EXPECT_LT(time->value(), near_s2);
  EXPECT_THAT(panoramas->currentText().toStdString(), HasSubstr("panoramas/p000.jpg"));
  window_->workspace()->Select("image:run1/images/000009.jpg");
  EXPECT_EQ(time->value(), 9);
  EXPECT_EQ(window_->images()->image(), "images/000009.jpg");
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000009.jpg");
  // A desk that leads: Panoramas and Compare.
  panoramas->setCurrentIndex(panoramas->findText("panoramas/p003.jpg", Qt::MatchStartsWith));
  emit panoramas->activated(panoramas->currentIndex());
  EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p003.jpg");
  EXPECT_EQ(compared->selectedItems().front()->data(Qt::UserRole).toString(), "station:S3");
}

TEST_F(SelectionTest, ASetCalledByANumberIsItsStationAndTag) {
  QDir().mkpath(Path("photos/station_002"));
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(Qt::darkGreen);
    ASSERT_TRUE(photo.save(Path("photos/station_002/") + name));
  }
  window_->workspace()->Reload();
  auto* set = Child<QComboBox>(window_.get(), "panorama.set");
  ASSERT_TRUE(WaitFor([&] { return set->findText("station_002 (photo set)") >= 0; }));
  window_->workspace()->Select("panorama:station_002");
  EXPECT_EQ(window_->workspace()->related().count("station:S2"), 1u);
  EXPECT_EQ(window_->workspace()->related().count("tag:2"), 1u);
  window_->workspace()->Select("tag:2");
  EXPECT_EQ(window_->workspace()->related().count("panorama:station_002"), 1u);
  EXPECT_EQ(window_->workspace()->related().count("station:S1"), 0u);
  QDir(Path("photos")).removeRecursively();
}

TEST_F(SelectionTest, AContextMenuExcludesWithAReasonToPick) {
  ShowErrors();
  QSignalSpy decided(window_->decisions(), &Decisions::Decided);
  const QPoint at = view_->visualRect(view_->model()->index(RowWith(view_, "S2"), 0)).center();
  emit view_->customContextMenuRequested(at);
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  QMenu* reasons = Reasons("exclude station:S2");
  ASSERT_NE(reasons, nullptr);
  EXPECT_NE(Reasons("exclude tag:2"), nullptr);
  EXPECT_NE(Reasons("role control:2"), nullptr);
  EXPECT_EQ(Reasons("exclude control:2"), nullptr);  // control points are no such objects
  const std::string reason = reasons->actions().front()->text().toStdString();
  reasons->actions().front()->trigger();
  OpenedMenu()->close();
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 1; }));
  EXPECT_TRUE(Excluded("station:S2"));
  EXPECT_THAT(ReadTextFile(Path("review.jsonl").toStdString()), HasSubstr(reason));
  // The tree offers to restore it now.
  auto* tree = window_->tree();
  const auto found = tree->findItems("S2", Qt::MatchExactly | Qt::MatchRecursive);
  ASSERT_FALSE(found.isEmpty());
  tree->scrollToItem(found.front());
  emit tree->customContextMenuRequested(tree->visualItemRect(found.front()).center());
  QMenu* restore = Reasons("restore station:S2");
  ASSERT_NE(restore, nullptr);
  restore->actions().front()->trigger();
  OpenedMenu()->close();
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 2; }));
  EXPECT_FALSE(Excluded("station:S2"));
}

TEST_F(SelectionTest, UndoOfDecisionsIsApartFromThatOfText) {
  window_->ShowDesk("review");
  QSignalSpy decided(window_->decisions(), &Decisions::Decided);
  window_->decisions()->Decide("exclude", "station:S1", "was moved");
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 1; }));
  auto* undo = Child<QAction>(window_.get(), "edit.undo");
  EXPECT_THAT(undo->text().toStdString(), HasSubstr("station:S1"));
  // In the field Ctrl+Z takes back the typing, and no decision.
  auto* reason = Child<QLineEdit>(window_.get(), "review.reason");
  reason->setFocus();
  QTest::keyClicks(reason, "a thought");
  QTest::keyClick(reason, Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(reason->text(), "");
  QTest::keyClicks(reason, "another");
  QTest::qWait(200);
  EXPECT_EQ(decided.count(), 1);
  EXPECT_TRUE(Excluded("station:S1"));
  // Outside it takes back the decision, and leaves the text alone.
  auto* entries = Child<QTableWidget>(window_.get(), "review.entries");
  entries->setFocus();
  QTest::keyClick(entries, Qt::Key_Z, Qt::ControlModifier);
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 2; }));
  EXPECT_FALSE(Excluded("station:S1"));
  EXPECT_EQ(reason->text(), "another");
  EXPECT_THAT(ReadTextFile(Path("review.jsonl").toStdString()), testing::Not(HasSubstr("another")));
  EXPECT_FALSE(undo->isEnabled());
  QTest::keyClick(entries, Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 3; }));
  EXPECT_TRUE(Excluded("station:S1"));
  EXPECT_EQ(entries->item(2, 5)->text(), "was moved");  // with its own reason
  EXPECT_FALSE(Child<QAction>(window_.get(), "edit.redo")->isEnabled());
}

}  // namespace
}  // namespace trigpoint
