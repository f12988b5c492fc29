// The report's charts on the screen: a mark selects, and what is selected elsewhere is marked.
#include <gmock/gmock.h>

#include <QAction>
#include <QLabel>
#include <QListWidget>
#include <QMenu>
#include <QTableWidget>

#include "app/desktop/charts_desk.h"
#include "app/desktop/picture_view.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class ChartsTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    WriteFileAtomically(Path("results/evaluate/summary.json").toStdString(), kEvaluateSummary);
    WriteFileAtomically(Path("results/survey/tags.csv").toStdString(),
                        "# trigpoint tags 1\ntag_id,role,status,size_m,x,y,z,rms_px,images,runs\n"
                        "0,control,ok,0.5,1,2,3,0.2,4,1\n2,,ok,0.5,4,2,3,0.9,4,1\n");
    std::string rows =
        "# trigpoint estimates 1\nsystem,run,timestamp,image,status,de_m,dn_m,du_m,reference_sigma_e_m,"
        "reference_sigma_n_m,reference_sigma_u_m\n";
    for (int i = 0; i < 24; ++i) {
      rows += "trigpoint,run1," + std::to_string(1000 + i / 2) + (i % 2 == 1 ? ".5" : ".0") + ",images/0000" +
              (i < 10 ? "0" : "") + std::to_string(i) + ".jpg,estimated," + std::to_string(0.01 * (i % 5)) +
              ",0.01,0.0,0.02,0.02,0.02\n";
    }
    WriteFileAtomically(Path("results/evaluate/estimates.csv").toStdString(), rows);
    WriteFileAtomically(Path("results/evaluate/estimates.json").toStdString(),
                        R"({"estimates": [{"system": "trigpoint", "run": "run1", "attempts": 24, "answers": 24}]})");
    ResultsWindowTest::SetUp();
    window_->ShowDesk("charts");
    charts_ = window_->charts();
    list_ = Child<QListWidget>(window_.get(), "charts.list");
    ASSERT_TRUE(WaitFor([&] { return list_->count() > 0; }));
  }
  // Where a mark of an object is on the screen.
  QPoint At(const QString& object) const {
    for (const PictureMark& mark : charts_->view()->marks()) {
      if (mark.object == object) return charts_->view()->WidgetAt(mark.points[0]).toPoint();
    }
    return {-1, -1};
  }
  // Is the orange ring of the selection drawn about it?
  bool Ringed(const QString& object) {
    const QPoint at = At(object);
    const QImage seen = charts_->view()->grab().toImage();
    int since_white = 9;  // the edge of the ring, then the ring itself, with what lies between
    for (int dx = 2; dx < 24; ++dx) {
      // Aslant: an axis runs straight.
      const QColor colour = seen.pixelColor(std::min(at.x() + dx, seen.width() - 1), at.y() + dx / 2);
      since_white = colour.lightness() > 230 ? 0 : since_white + 1;
      if (since_white < 4 && colour.lightness() < 40) return true;
    }
    return false;
  }

  ChartsDesk* charts_ = nullptr;
  QListWidget* list_ = nullptr;
};

TEST_F(ChartsTest, AreThoseOfTheReport) {
  QStringList names;
  for (int row = 0; row < list_->count(); ++row) names << list_->item(row)->data(Qt::UserRole).toString();
  for (const char* name : {"cumulative_absolute", "by_station_single-against-control-absolute", "nees", "trust_curve",
                           "camera_errors_1", "residuals_over_time", "tag_residuals"}) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
  EXPECT_GE(RowWith(list_, "Camera errors of trigpoint on run1"), 0);
  EXPECT_FALSE(charts_->view()->image().isNull());
  EXPECT_THAT(Child<QLabel>(window_.get(), "charts.caption")->text().toStdString(), HasSubstr("Cumulative histogram"));
  Screenshot(window_.get(), "charts");
}

TEST_F(ChartsTest, AMarkSelectsAndTheSelectionIsMarked) {
  ASSERT_TRUE(charts_->Choose("by_station_single-against-control-absolute"));
  QTest::mouseClick(charts_->view(), Qt::LeftButton, {}, At("station:S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  EXPECT_TRUE(Ringed("station:S2"));
  EXPECT_FALSE(Ringed("station:S0"));
  Screenshot(window_.get(), "charts_station");
  // From a table, and in the curve.
  ASSERT_TRUE(charts_->Choose("cumulative_absolute"));
  window_->workspace()->Select("panorama:panoramas/p003.jpg");
  EXPECT_TRUE(Ringed("station:S3"));
  EXPECT_FALSE(Ringed("station:S2"));
  // The residual of a tag, and of its station.
  ASSERT_TRUE(charts_->Choose("tag_residuals"));
  EXPECT_FALSE(Ringed("tag:2"));
  window_->workspace()->Select("station:S2");
  EXPECT_TRUE(Ringed("tag:2"));
  // Along the run an image is selected, and seen on its desk.
  ASSERT_TRUE(charts_->Choose("camera_errors_1"));
  QTest::mouseClick(charts_->view(), Qt::LeftButton, {}, At("image:run1/images/000007.jpg"));
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000007.jpg");
  Screenshot(window_.get(), "charts_run");
  ASSERT_TRUE(charts_->Choose("residuals_over_time"));
  EXPECT_TRUE(Ringed("image:run1/images/000007.jpg"));
  QTest::mouseDClick(charts_->view(), Qt::LeftButton, {}, At("image:run1/images/000011.jpg"));
  EXPECT_EQ(window_->desk(), "images");
}

TEST_F(ChartsTest, TheSelectionIsOnTheAxisOfTheHistogramAndABarListsWhatIsInIt) {
  ASSERT_TRUE(charts_->Choose("nees"));
  window_->workspace()->Select("station:S2");
  const QPoint at = At("station:S2");
  ASSERT_GT(at.x(), 0);
  EXPECT_TRUE(Ringed("station:S2"));
  EXPECT_EQ(charts_->view()->marks().back().layer, "bars");
  // All four errors have one NEES, so that one bar has all.
  QTest::mouseClick(charts_->view(), Qt::LeftButton, {}, at - QPoint(0, 40));
  auto* menu = Child<QMenu>(window_.get(), "charts.group");
  QStringList stations;
  for (QAction* action : menu->actions()) {
    if (!action->isSeparator()) stations << action->text();
  }
  EXPECT_EQ(stations.join(' ').toStdString(), "station:S0 station:S1 station:S2 station:S3");
  menu->actions().back()->trigger();
  menu->close();
  EXPECT_EQ(window_->workspace()->selected(), "station:S3");
  EXPECT_TRUE(Ringed("station:S3"));
  QTest::mouseClick(charts_->view(), Qt::LeftButton, {}, {at.x() + 150, at.y() - 40});  // no bar
  EXPECT_EQ(window_->workspace()->selected(), "station:S3");
}

TEST_F(ChartsTest, ABarOfTheResidualsListsItsPointsAndTheSelectionMarksTheBar) {
  ASSERT_TRUE(charts_->Choose("residuals"));
  const auto bars = [this] {
    std::vector<PictureMark> marked = charts_->view()->marks();
    std::erase_if(marked, [](const PictureMark& mark) { return mark.layer != "bars"; });
    return marked;
  };
  EXPECT_TRUE(bars().empty());
  // A point that is selected elsewhere marks its bar.
  window_->workspace()->Select("point:run1/7");
  ASSERT_EQ(bars().size(), 1u);
  EXPECT_TRUE(bars().front().strong);
  const QRectF bar = bars().front().points.boundingRect();
  Screenshot(window_.get(), "charts_residuals");
  // A click in the bar lists what is in it, not all of 2000 points.
  QTest::mouseClick(charts_->view(), Qt::LeftButton, {}, charts_->view()->WidgetAt(bar.center()).toPoint());
  auto* menu = Child<QMenu>(window_.get(), "charts.group");
  ASSERT_NE(menu, nullptr);
  QList<QAction*> points = menu->actions();
  EXPECT_THAT(points.front()->text().toStdString(), HasSubstr("2000"));
  EXPECT_THAT(points.back()->text().toStdString(), HasSubstr("1970 more"));
  EXPECT_EQ(points.size(), 32);
  const QString chosen = points[2]->text();
  EXPECT_TRUE(chosen.startsWith("point:run1/"));
  points[2]->trigger();
  menu->close();
  EXPECT_EQ(window_->workspace()->selected(), chosen);
  EXPECT_EQ(bars().size(), 1u);
  window_->workspace()->Select("station:S2");
  EXPECT_TRUE(bars().empty());
  // In how many images a point is, likewise.
  ASSERT_TRUE(charts_->Choose("track_lengths"));
  window_->workspace()->Select("point:run1/7");
  EXPECT_EQ(bars().size(), 1u);
}

TEST_F(ChartsTest, FollowTheUnitAndAnotherProject) {
  ASSERT_TRUE(charts_->Choose("cumulative_absolute"));
  window_->workspace()->SetUnit("ft");
  const auto* caption = Child<QLabel>(window_.get(), "charts.caption");
  EXPECT_TRUE(WaitFor([&] { return caption->text().contains("(ft, logarithmic)"); }));
  window_->workspace()->Close();
  EXPECT_EQ(list_->count(), 0);
  EXPECT_TRUE(charts_->view()->image().isNull());
}

}  // namespace
}  // namespace trigpoint
