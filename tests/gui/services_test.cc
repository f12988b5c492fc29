// The map of what services have: found along the run, by year, picked on the map and in the table, loaded.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <QAction>
#include <QComboBox>
#include <QFile>
#include <QLabel>
#include <QSignalSpy>
#include <QTableWidget>

#include "app/desktop/services_dialog.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

// Ten panoramas in a row along the area's first points, of three years.
class RowOfPanoramas final : public PanoramaProvider {
 public:
  explicit RowOfPanoramas(std::string name) : name_(std::move(name)) {}
  std::string Name() const override { return name_; }
  std::string Prefix() const override { return name_ + "-"; }
  SourceQuality Sigmas() const override { return {3, 20, 5, 4}; }
  std::vector<PanoramaRecord> Find(const SearchArea& area, const CancelToken&) override {
    std::vector<PanoramaRecord> records;
    for (int i = 0; i < 10; ++i) {
      PanoramaRecord r;
      r.id = "p" + std::to_string(i);
      r.position = area.points.front();
      r.position.latitude_deg += (name_ == "panoramax" ? 5e-5 : -5e-5) * (i + 1);
      r.heading_deg = 10.0 * i;
      r.date = std::to_string(2022 + i % 3) + "-05-12";
      r.owner = "Ann", r.licence = "CC-BY-SA-4.0", r.attribution = "Ann, CC-BY-SA-4.0";
      records.push_back(r);
    }
    return records;
  }
  PanoramaPicture Load(const PanoramaRecord&, int, const CancelToken&) override {
    PanoramaPicture picture;
    picture.pixels = cv::Mat(64, 128, CV_8UC3, cv::Scalar(90, 120, 150));
    return picture;
  }

 private:
  std::string name_;
};

class ServicesTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    std::string gps = "timestamp_s,latitude_deg,longitude_deg,sigma_h_m\n";
    for (int i = 0; i < 30; ++i) gps += fmt::format("{},48.0000{:02},7.80{:03},1\n", 1000 + i, i % 7, 10 * i);
    WriteFileAtomically(Path("runs/run1/gps.csv").toStdString(), gps);
    ResultsWindowTest::SetUp();
  }
  ServicesDialog* Open() {
    auto* dialog = new ServicesDialog(
        window_->workspace(), window_.get(),
        [](const Service& service, const ServiceOptions&) { return std::make_unique<RowOfPanoramas>(service.name); });
    dialog->show();
    return dialog;
  }
  void Search(ServicesDialog* dialog) {
    QSignalSpy searched(dialog, &ServicesDialog::Searched);
    Click(dialog, "services.search");
    ASSERT_TRUE(WaitFor([&] { return searched.count() == 1; }));
    ASSERT_TRUE(searched.front().front().toBool()) << Child<QLabel>(dialog, "services.status")->text().toStdString();
  }
};

TEST_F(ServicesTest, WhatIsThereIsPickedOnTheMapAndLoaded) {
  ServicesDialog* dialog = Open();
  Search(dialog);
  EXPECT_THAT(Child<QLabel>(dialog, "services.status")->text().toStdString(), HasSubstr("panoramax has 10 panoramas"));
  auto* table = Child<QTableWidget>(dialog, "services.table");
  ASSERT_EQ(table->rowCount(), 10);
  EXPECT_FALSE(Child<QAbstractButton>(dialog, "services.load")->isEnabled());
  // One on the map, one in the table.
  auto* map = Child<ServicesMap>(dialog, "services.map");
  QTest::mouseClick(map, Qt::LeftButton, {}, map->PlaceOf(9));
  EXPECT_TRUE(dialog->found()[9].picked);
  EXPECT_EQ(table->item(9, 0)->checkState(), Qt::Checked);
  table->item(2, 0)->setCheckState(Qt::Checked);
  EXPECT_TRUE(dialog->found()[2].picked);
  EXPECT_THAT(
      Child<QLineEdit>(dialog, "services.line")->text().toStdString(),
      AllOf(HasSubstr("--from panoramax --along run1 --radius 30"), HasSubstr("--id p2"), HasSubstr("--id p9")));
  // Enter on a row picks it, and again leaves it.
  table->setFocus();
  table->setCurrentCell(4, 3);
  QTest::keyClick(table, Qt::Key_Return);
  EXPECT_TRUE(dialog->found()[4].picked);
  EXPECT_EQ(table->item(4, 0)->checkState(), Qt::Checked);
  EXPECT_TRUE(dialog->isVisible());
  QTest::keyClick(table, Qt::Key_Enter);
  EXPECT_FALSE(dialog->found()[4].picked);
  // Another source joins it on the map.
  auto* service = Child<QComboBox>(dialog, "services.service");
  service->setCurrentIndex(2);
  Search(dialog);
  EXPECT_EQ(table->rowCount(), 20);
  service->setCurrentIndex(0);
  Screenshot(dialog, "services");
  QSignalSpy loaded(dialog, &ServicesDialog::Loaded);
  Click(dialog, "services.load");
  ASSERT_TRUE(WaitFor([&] { return loaded.count() == 1; }));
  EXPECT_TRUE(loaded.front().front().toBool()) << Child<QLabel>(dialog, "services.status")->text().toStdString();
  const std::string rows = ReadTextFile(Path("panoramas.csv").toStdString());
  EXPECT_THAT(rows, AllOf(HasSubstr("panoramas/panoramax-p2.jpg"), HasSubstr("panoramas/panoramax-p9.jpg"),
                          Not(HasSubstr("panoramas/panoramax-p3.jpg"))));
  dialog->close();
}

TEST_F(ServicesTest, APermissionIsAskedForWhereOneIsNeeded) {
  ServicesDialog* dialog = Open();
  auto* permitted = Child<QAbstractButton>(dialog, "services.permitted");
  EXPECT_FALSE(permitted->isVisible());
  Child<QComboBox>(dialog, "services.service")->setCurrentIndex(3);
  EXPECT_TRUE(permitted->isVisible());
  Search(dialog);
  Click(dialog, "services.all");
  EXPECT_FALSE(Child<QAbstractButton>(dialog, "services.load")->isEnabled());
  permitted->click();
  EXPECT_TRUE(Child<QAbstractButton>(dialog, "services.load")->isEnabled());
  EXPECT_THAT(Child<QLineEdit>(dialog, "services.line")->text().toStdString(), HasSubstr("--permitted"));
  dialog->close();
}

TEST_F(ServicesTest, DistancesAreInTheUnitShown) {
  ServicesDialog* dialog = Open();
  Search(dialog);
  auto* table = Child<QTableWidget>(dialog, "services.table");
  const auto* map = Child<ServicesMap>(dialog, "services.map");
  EXPECT_TRUE(table->item(0, 4)->text().endsWith(" m"));
  EXPECT_TRUE(map->ScaleText().endsWith(" m"));
  window_->workspace()->SetUnit("ft");
  EXPECT_TRUE(table->item(0, 4)->text().endsWith(" ft"));
  EXPECT_TRUE(map->ScaleText().endsWith(" ft"));
  EXPECT_THAT(table->horizontalHeaderItem(4)->toolTip().toStdString(), HasSubstr("in the unit shown"));
  dialog->close();
}

TEST_F(ServicesTest, TheFileWithTheKeyIsChosenByADialog) {
  ServicesDialog* dialog = Open();
  EXPECT_FALSE(Child<QAbstractButton>(dialog, "services.key_browse")->isEnabled());  // none is needed
  Child<QComboBox>(dialog, "services.service")->setCurrentIndex(3);
  Click(dialog, "services.key_browse");
  ChoosePath(dialog, Path("tags.yaml"));
  EXPECT_EQ(Child<QLineEdit>(dialog, "services.key")->text(), "tags.yaml");
  EXPECT_THAT(Child<QLineEdit>(dialog, "services.line")->text().toStdString(),
              HasSubstr("--token-file " + Path("tags.yaml").toStdString()));
  dialog->close();
}

TEST_F(ServicesTest, FitsIntoASmallScreen) {
  ServicesDialog* dialog = Open();
  Search(dialog);
  dialog->resize(1024, 700);
  ASSERT_TRUE(WaitFor([&] { return dialog->width() <= 1024 && dialog->height() <= 700; }))
      << dialog->width() << " x " << dialog->height();
  auto* map = Child<ServicesMap>(dialog, "services.map");
  EXPECT_GE(map->width(), 300);
  EXPECT_GE(map->height(), 200);
  EXPECT_TRUE(dialog->rect().contains(QRect(map->mapTo(dialog, {0, 0}), map->size())));
  Screenshot(dialog, "small_services");
  dialog->close();
}

TEST_F(ServicesTest, TheMenuOpensIt) {
  MenuAction("Panoramas of services ...")->trigger();
  Child<ServicesDialog>(window_.get(), "services")->close();
}

}  // namespace
}  // namespace trigpoint
