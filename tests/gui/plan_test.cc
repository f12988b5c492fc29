// The desk on which a survey is drawn before the trip.
#include <gmock/gmock.h>

#include <QAction>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QMenu>
#include <QMessageBox>
#include <QPushButton>
#include <QSignalSpy>
#include <QTableWidget>
#include <algorithm>
#include <filesystem>

#include "app/desktop/decisions.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/plan_desk.h"
#include "datasets/io/site_sketch.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

namespace fs = std::filesystem;

class PlanDeskTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    window_->ShowDesk("plan");
    desk_ = window_->plan();
    ASSERT_TRUE(WaitFor([&] { return !desk_->map()->image().isNull(); }));
  }
  void TearDown() override {
    window_.reset();
    fs::remove(Path("plan.csv").toStdString());
    fs::remove_all(Path("results/plan").toStdString());
  }
  void Tool(const char* name) { Click(window_.get(), (std::string("plan.tool_") + name).c_str()); }
  void ClickAt(double east, double north) {
    QTest::mouseClick(desk_->map(), Qt::LeftButton, {},
                      desk_->map()->WidgetAt(desk_->ground().PixelOf({east, north})).toPoint());
  }
  size_t Count(const std::string& kind) const {
    const auto& items = desk_->sketch().items();
    return static_cast<size_t>(
        std::count_if(items.begin(), items.end(), [&](const SketchItem& item) { return item.kind == kind; }));
  }

  PlanDesk* desk_ = nullptr;
};

TEST_F(PlanDeskTest, WhatIsDrawnIsPredicted) {
  ASSERT_TRUE(desk_->sketch().items().empty());
  // Four tags round a square; each faces its middle.
  Tool("tag");
  for (const auto& [east, north] : {std::pair(-7.0, 0.0), {7.0, 0.0}, {0.0, 7.0}, {0.0, -7.0}}) {
    ClickAt(east, north);
    ClickAt(0.2 * east, 0.2 * north);
  }
  ASSERT_EQ(Count("tag"), 4U);
  const SketchItem west = desk_->sketch().items()[0];
  const double pixel_m = 1 / (desk_->ground().px_per_m * desk_->map()->scale());
  EXPECT_NEAR(west.local_m->x(), -7, pixel_m);
  EXPECT_NEAR(*west.heading_rad, M_PI / 2, 0.05);  // east
  Tool("control");
  ClickAt(-7, 0);
  ClickAt(7, 0);
  Tool("check");
  ClickAt(0, 7);
  EXPECT_EQ(Count("control"), 2U);
  EXPECT_EQ(Count("check"), 1U);
  Tool("station");
  ClickAt(1, 6);
  ASSERT_EQ(Count("station"), 1U);
  Tool("path");
  for (const auto& [east, north] : {std::pair(-4.0, 0.0), {4.0, 0.0}, {0.0, 4.0}, {0.0, -4.0}, {-4.0, 0.0}}) {
    ClickAt(east, north);
  }
  EXPECT_EQ(Count("path"), 5U);
  Screenshot(window_.get(), "plan_drawn");

  Click(window_.get(), "plan.predict");
  auto* tags = Child<QTableWidget>(window_.get(), "plan.tags");
  ASSERT_TRUE(WaitFor([&] { return tags->rowCount() == 4 && !window_->jobs()->running(); }))
      << Child<QLabel>(window_.get(), "plan.prediction")->text().toStdString();
  const std::vector<SketchItem> saved = ReadSiteSketch(Path("plan.csv").toStdString());
  ASSERT_EQ(saved.size(), desk_->sketch().items().size());
  for (size_t i = 0; i < saved.size(); ++i) {
    EXPECT_EQ(saved[i].kind, desk_->sketch().items()[i].kind);
    EXPECT_EQ(saved[i].name, desk_->sketch().items()[i].name);
  }
  EXPECT_TRUE(fs::exists(Path("results/plan/index.html").toStdString()));
  for (int row = 0; row < 4; ++row) EXPECT_GT(tags->item(row, 6)->text().toDouble(), 0) << row;
  EXPECT_THAT(tags->horizontalHeaderItem(6)->toolTip().toStdString(), testing::HasSubstr("1 sigma in space, mm"));
  EXPECT_GT(Child<QTableWidget>(window_.get(), "plan.gains")->rowCount(), 0);
  const auto ellipses = [&] {
    const auto& marks = desk_->map()->marks();
    return std::count_if(marks.begin(), marks.end(),
                         [](const PictureMark& m) { return m.kind == PictureMark::Kind::kOutline; });
  };
  EXPECT_EQ(ellipses(), 4);
  Screenshot(window_.get(), "plan");

  // A change makes the prediction old: it is not drawn over a sketch that it does not belong to.
  Tool("select");
  ClickAt(7, 0);
  EXPECT_EQ(window_->workspace()->selected().left(4), "tag:");
  Click(window_.get(), "plan.remove");
  EXPECT_EQ(Count("tag"), 3U);
  EXPECT_EQ(Count("control"), 1U);
  EXPECT_EQ(ellipses(), 0);
  Click(window_.get(), "plan.undo");
  EXPECT_EQ(Count("tag"), 4U);
  EXPECT_EQ(Count("control"), 2U);
}

TEST_F(PlanDeskTest, CellsAreEditedAndWrongOnesRefused) {
  Tool("tag");
  ClickAt(3, 3);
  ClickAt(0, 0);
  auto* items = Child<QTableWidget>(window_.get(), "plan.items");
  ASSERT_EQ(items->rowCount(), 1);
  items->item(0, 2)->setText("4.25");
  EXPECT_TRUE(WaitFor([&] { return desk_->sketch().items()[0].local_m->x() == 4.25; }));
  ASSERT_TRUE(WaitFor([&] { return items->item(0, 2)->text() == "4.250"; }));
  items->item(0, 2)->setText("four");
  ASSERT_TRUE(WaitFor([&] { return items->item(0, 2)->text() == "4.250"; }));
  EXPECT_THAT(Child<QLabel>(window_.get(), "plan.hint")->text().toStdString(), testing::HasSubstr("'four'"));
  EXPECT_EQ(desk_->sketch().items()[0].local_m->x(), 4.25);
  // Saved twice, the first file is kept.
  Click(window_.get(), "plan.save");
  items->item(0, 5)->setText("90");
  auto* save = Child<QPushButton>(window_.get(), "plan.save");
  ASSERT_TRUE(WaitFor([&] { return desk_->sketch().changed() && save->isEnabled(); }));
  Click(window_.get(), "plan.save");
  EXPECT_FALSE(desk_->sketch().changed());
  EXPECT_FALSE(fs::is_empty(Path("results/replaced").toStdString()));
  EXPECT_NEAR(*ReadSiteSketch(Path("plan.csv").toStdString())[0].heading_rad, M_PI / 2, 1e-6);
}

TEST_F(PlanDeskTest, AnUnsavedSketchIsNotLostWithoutAQuestion) {
  const auto draw = [&] {
    Tool("tag");
    ClickAt(3, 3);
    ClickAt(0, 0);
    ASSERT_TRUE(desk_->sketch().changed());
  };
  const auto answer = [&](QMessageBox::StandardButton button) {
    auto* ask = Child<QMessageBox>(window_.get(), "plan.ask");
    ASSERT_NE(ask, nullptr);
    ask->button(button)->click();
    ASSERT_TRUE(WaitFor([&] { return window_->findChild<QMessageBox*>("plan.ask") == nullptr; }));
  };
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  draw();
  window_->OpenProject(other.path());
  answer(QMessageBox::Cancel);
  EXPECT_FALSE(window_->workspace()->opening());
  EXPECT_EQ(Count("tag"), 1U);
  window_->OpenProject(site_->path());  // again: nothing is lost
  EXPECT_EQ(window_->findChild<QMessageBox*>("plan.ask"), nullptr);
  ASSERT_TRUE(WaitFor([&] { return !window_->workspace()->opening(); }));
  EXPECT_EQ(Count("tag"), 1U);
  window_->OpenProject(other.path());
  answer(QMessageBox::Discard);
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->dir() == other.path(); }));
  EXPECT_FALSE(desk_->sketch().changed());
  ASSERT_TRUE(WaitFor([&] { return !desk_->map()->image().isNull(); }));
  draw();
  window_->close();
  EXPECT_TRUE(window_->isVisible());
  answer(QMessageBox::Save);
  EXPECT_TRUE(WaitFor([&] { return !window_->isVisible(); }));
  EXPECT_EQ(ReadSiteSketch(other.filePath("plan.csv").toStdString()).size(), 1U);
  EXPECT_FALSE(fs::exists(Path("plan.csv").toStdString()));
}

TEST_F(PlanDeskTest, UndoIsOfTheDeskInFront) {
  QSignalSpy decided(window_->decisions(), &Decisions::Decided);
  window_->decisions()->Decide("exclude", "station:S1", "was moved");
  ASSERT_TRUE(WaitFor([&] { return decided.count() == 1; }));
  const std::string review = ReadTextFile(Path("review.jsonl").toStdString());
  auto* undo = Child<QAction>(window_.get(), "edit.undo");
  auto* redo = Child<QAction>(window_.get(), "edit.redo");
  EXPECT_FALSE(undo->isEnabled());
  Tool("station");
  ClickAt(3, 3);
  ASSERT_EQ(Count("station"), 1U);
  EXPECT_EQ(undo->text().remove('&'), "Undo: draw station S1");
  desk_->map()->setFocus();
  QTest::keyClick(desk_->map(), Qt::Key_Z, Qt::ControlModifier);
  EXPECT_EQ(Count("station"), 0U);
  EXPECT_FALSE(undo->isEnabled());
  EXPECT_EQ(redo->text().remove('&'), "Redo: draw station S1");
  QTest::keyClick(desk_->map(), Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
  EXPECT_EQ(Count("station"), 1U);
  Click(window_.get(), "plan.undo");
  EXPECT_EQ(Count("station"), 0U);
  Click(window_.get(), "plan.redo");
  EXPECT_EQ(Count("station"), 1U);
  window_->ShowDesk("images");  // no mark was set, and no decision is taken for one
  EXPECT_FALSE(undo->isEnabled());
  QTest::keyClick(window_->images()->left(), Qt::Key_Z, Qt::ControlModifier);
  QTest::qWait(200);
  EXPECT_EQ(decided.count(), 1);
  EXPECT_EQ(ReadTextFile(Path("review.jsonl").toStdString()), review);
  window_->ShowDesk("tables");
  EXPECT_EQ(undo->text().remove('&'), "Undo: exclude station:S1");
  QFile::remove(Path("review.jsonl"));
}

TEST_F(PlanDeskTest, ItemsAreSelectedEverywhere) {
  Tool("tag");
  for (const double east : {-5.0, 5.0}) {
    ClickAt(east, 3);
    ClickAt(east, 0);
  }
  Tool("select");
  auto* items = Child<QTableWidget>(window_.get(), "plan.items");
  ASSERT_EQ(items->rowCount(), 2);
  const int first = desk_->sketch().items()[0].tag_id, second = desk_->sketch().items()[1].tag_id;
  ClickRow(items, 1);
  EXPECT_EQ(window_->workspace()->selected(), QString("tag:%1").arg(second));
  window_->workspace()->Select(QString("station:S%1").arg(first));  // to which the tag belongs
  ASSERT_EQ(items->selectedItems().size(), items->columnCount());
  EXPECT_EQ(items->selectedItems().front()->row(), 0);
  window_->workspace()->Select("");
  EXPECT_TRUE(items->selectedItems().isEmpty());
  emit desk_->map()->MenuAsked("sketch:1", QPoint(10, 10));
  auto* menu = Child<QMenu>(window_.get(), "object.menu");
  ASSERT_NE(menu, nullptr);
  menu->close();
  EXPECT_EQ(window_->workspace()->selected(), QString("tag:%1").arg(second));
}

TEST_F(PlanDeskTest, ThePlanIsInTheUnitShown) {
  const auto* height = Child<QDoubleSpinBox>(window_.get(), "plan.height");
  EXPECT_EQ(height->text(), "up 1.50 m");
  const QImage metres = desk_->map()->image();
  window_->workspace()->SetUnit("ft");
  EXPECT_EQ(height->text(), "up 4.92 ft");
  EXPECT_NE(desk_->map()->image(), metres);  // another grid
  Tool("station");
  ClickAt(3, 3);
  EXPECT_NEAR(desk_->sketch().items().back().local_m->z(), 1.5, 0.002);
}

TEST_F(PlanDeskTest, ColumnsSayWhatTheyMean) {
  for (const char* name : {"plan.tags", "plan.gains"}) {  // before anything is predicted
    const auto* table = Child<QTableWidget>(window_.get(), name);
    ASSERT_NE(table->horizontalHeaderItem(0), nullptr) << name;
    EXPECT_FALSE(table->horizontalHeaderItem(0)->toolTip().isEmpty()) << name;
  }
  const auto* items = Child<QTableWidget>(window_.get(), "plan.items");
  for (int c = 0; c < items->columnCount(); ++c) {
    EXPECT_FALSE(items->horizontalHeaderItem(c)->toolTip().isEmpty()) << c;
  }
  window_->workspace()->SetUnit("ft");
  EXPECT_THAT(items->horizontalHeaderItem(2)->toolTip().toStdString(), testing::HasSubstr("ft"));
}

}  // namespace
}  // namespace trigpoint
