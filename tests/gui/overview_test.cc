// The overview: what a project opens on.
#include <gmock/gmock.h>

#include <QLabel>
#include <QPushButton>
#include <QSignalSpy>
#include <QTableWidget>

#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

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
  EXPECT_EQ(card->item(0, 0)->text(), "absolute, panorama (G2), against surveyed control");
  const char* expected[] = {"run1", "0.030", "0.030", "0.000", "0.000", "0.107", "0.1", "0.33"};
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

TEST_F(OverviewTest, NextIsWhatStatusAdvises) {
  auto* next = Child<QPushButton>(window_.get(), "overview.next");
  ASSERT_TRUE(WaitFor([&] { return next->isVisible(); }));
  EXPECT_THAT(Child<QLabel>(window_.get(), "overview.next_text")->text().toStdString(),
              HasSubstr("Missing or out of date"));
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

}  // namespace
}  // namespace trigpoint
