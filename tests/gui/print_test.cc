// The desk that prints: its pages are the PDF's, the PDF is written and its tags are listed, a measured bar corrects
// their sizes, and what is wrong is named.
#include <gmock/gmock.h>

#include <QComboBox>
#include <QDirIterator>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QSignalSpy>
#include <QTableWidget>
#include <opencv2/core.hpp>

#include "app/desktop/picture_view.h"
#include "app/desktop/print_desk.h"
#include "datasets/io/tables.h"
#include "datasets/io/text.h"
#include "survey/tags/detection.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class PrintDeskTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    tags_ = ReadTextFile(Path("tags.yaml").toStdString());
    ResultsWindowTest::SetUp();
    window_->ShowDesk("print");
    desk_ = window_->print();
    // As it opens, it proposes tags that the site does not have yet.
    ASSERT_TRUE(WaitFor([&] { return desk_->pages() > 0 && !desk_->view()->image().isNull(); })) << Problem();
  }
  void TearDown() override {
    QDir(Path("print")).removeRecursively();
    WriteFileAtomically(Path("tags.yaml").toStdString(), tags_);
  }
  std::string Problem() {
    const auto* problem = Child<QLabel>(desk_, "print.problem");
    return problem->isVisible() ? problem->text().toStdString() : "";
  }
  std::string Status() { return Child<QLabel>(desk_, "print.status")->text().toStdString(); }
  QComboBox* Choice(const char* name) { return Child<QComboBox>(desk_, name); }
  void SetLength(const char* name, double mm) { Child<QDoubleSpinBox>(desk_, name)->setValue(mm); }
  double Nominal() { return Child<QDoubleSpinBox>(desk_, "print.nominal")->value(); }
  // Changes the form by `change` and waits until the pages or what is wrong with it are shown.
  void Change(const std::function<void()>& change) {
    QSignalSpy previewed(desk_, &PrintDesk::Previewed);
    change();
    ASSERT_TRUE(WaitFor([&] { return previewed.count() > 0; }));
  }
  bool ClickAndWait(const char* button) {
    QSignalSpy ended(desk_, &PrintDesk::Ended);
    Click(desk_, button);
    EXPECT_TRUE(WaitFor([&] { return ended.count() == 1; })) << button;
    return ended.count() == 1 && ended[0][0].toBool();
  }
  void Turn(int page) {
    QSignalSpy previewed(desk_, &PrintDesk::Previewed);
    Click(desk_, page > desk_->page() ? "print.forward" : "print.back");
    ASSERT_TRUE(WaitFor([&] { return previewed.count() > 0; }));
    ASSERT_EQ(desk_->page(), page);
  }
  // Of the page that is shown, in its pixels.
  std::vector<TagDetection> TagsOnPage() {
    QImage grey = desk_->view()->image().convertToFormat(QImage::Format_Grayscale8);
    const cv::Mat pixels(grey.height(), grey.width(), CV_8U, grey.bits(), static_cast<size_t>(grey.bytesPerLine()));
    ProgressSink silent;
    return DetectTags(
               1, [&](int64_t) { return pixels.clone(); }, [](int64_t) -> const Camera* { return nullptr; }, {}, 1,
               silent, CancelToken())
        .images.front()
        .detections;
  }
  QStringList Files() {
    QStringList files;
    QDirIterator all(site_->path(), QDir::Files | QDir::Hidden, QDirIterator::Subdirectories);
    while (all.hasNext()) files << all.next();
    files.sort();
    return files;
  }

  PrintDesk* desk_ = nullptr;
  std::string tags_;
};

TEST_F(PrintDeskTest, PagesAreThoseOfThePdfAndNothingIsWritten) {
  const QStringList before = Files();
  Change([&] { Type(desk_, "print.ids", "100-101"); });
  ASSERT_EQ(desk_->pages(), 3) << Problem();  // a tag each, and where they were put
  EXPECT_EQ(desk_->page(), 0);
  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.back")->isEnabled());
  for (const int page : {0, 1}) {
    if (page > 0) Turn(page);
    const double mm_per_px = 210.0 / desk_->view()->image().width();
    EXPECT_NEAR(mm_per_px * desk_->view()->image().height(), 297, 0.3);
    const std::vector<TagDetection> tags = TagsOnPage();
    ASSERT_EQ(tags.size(), 1U) << page;
    EXPECT_EQ(tags[0].id, 100 + page);
    for (size_t k = 0; k < 4; ++k) {
      // The page is drawn with edges at whole pixels.
      EXPECT_NEAR(mm_per_px * (tags[0].corners[k] - tags[0].corners[(k + 1) % 4]).norm(), 160, mm_per_px) << page;
    }
  }
  EXPECT_THAT(desk_->view()->accessibleDescription().toStdString(), HasSubstr("2 of 3"));
  Screenshot(window_.get(), "print");
  Turn(2);
  EXPECT_TRUE(TagsOnPage().empty());
  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.forward")->isEnabled());
  Screenshot(window_.get(), "print_form");
  Turn(1);
  Change([&] { Choice("print.paper")->setCurrentText("300x500"); });
  EXPECT_NEAR(300.0 / desk_->view()->image().width() * desk_->view()->image().height(), 500, 0.6);
  EXPECT_EQ(Child<QLineEdit>(desk_, "print.command")->text().toStdString(),
            "trigpoint print " + site_->path().toStdString() + " --ids 100-101 --size 160 --paper 300x500");
  EXPECT_EQ(Files(), before);
}

TEST_F(PrintDeskTest, ThePdfIsWrittenItsTagsAreListedAndTheirSizesMeasured) {
  auto* printed = Child<QTableWidget>(desk_, "print.printed");
  EXPECT_EQ(printed->rowCount(), 0);
  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.enter")->isEnabled());
  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.open")->isEnabled());
  Type(desk_, "print.ids", "100-103,110");
  SetLength("print.size", 40);
  ASSERT_TRUE(ClickAndWait("print.print")) << Status();
  EXPECT_THAT(Status(), HasSubstr("print/tags_tag36h11_100_101_102_103_110_40mm.pdf"));
  EXPECT_THAT(Status(), HasSubstr("tags.yaml: 5"));
  EXPECT_TRUE(QFile::exists(Path("print/tags_tag36h11_100_101_102_103_110_40mm.pdf")));
  EXPECT_NEAR(ReadTagSizes(Path("tags.yaml").toStdString()).SizeOf(110), 0.040, 1e-9);
  ASSERT_EQ(printed->rowCount(), 1);
  EXPECT_EQ(printed->item(0, 0)->text(), "100-103, 110");
  EXPECT_EQ(printed->item(0, 1)->text(), "40");
  EXPECT_EQ(printed->item(0, 3)->text(), "");

  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.enter")->isEnabled());  // no length yet
  EXPECT_GE(Nominal(), 50);                                                 // the bar's, longer than a tag
  SetLength("print.across", 0.997 * Nominal());
  SetLength("print.up", 0.999 * Nominal());
  ASSERT_TRUE(ClickAndWait("print.enter")) << Status();
  const TagSizes sizes = ReadTagSizes(Path("tags.yaml").toStdString());
  for (const int id : {100, 101, 102, 103, 110}) EXPECT_NEAR(sizes.SizeOf(id), 0.040 * 0.998, 1e-6) << id;
  EXPECT_NEAR(sizes.SizeOf(0), 0.5, 1e-9);  // of the site, as it was
  EXPECT_EQ(printed->item(0, 2)->text(), "39.92");
  EXPECT_EQ(printed->item(0, 3)->text(), "99.80");

  // Another print is the newest; the first one is measured again when it is selected.
  Type(desk_, "print.ids", "120");
  ASSERT_TRUE(ClickAndWait("print.print")) << Status();
  ASSERT_EQ(printed->rowCount(), 2);
  EXPECT_EQ(printed->item(0, 0)->text(), "120");
  ClickRow(printed, 1);
  EXPECT_THAT(Child<QAbstractButton>(desk_, "print.enter")->text().toStdString(), HasSubstr("100-103, 110"));
  SetLength("print.across", 0.99 * Nominal());
  ASSERT_TRUE(ClickAndWait("print.enter")) << Status();
  EXPECT_NEAR(ReadTagSizes(Path("tags.yaml").toStdString()).SizeOf(103), 0.0396, 1e-6);
  EXPECT_NEAR(ReadTagSizes(Path("tags.yaml").toStdString()).SizeOf(120), 0.040, 1e-6);
  EXPECT_EQ(printed->item(1, 3)->text(), "99.00");
  ASSERT_TRUE(WaitFor([&] { return desk_->pages() == 2; }));  // the form's tag, and where it was put
  Screenshot(window_.get(), "print_measured");
}

TEST_F(PrintDeskTest, WhatIsWrongIsNamed) {
  Change([&] { Type(desk_, "print.ids", "60-"); });
  EXPECT_THAT(Problem(), HasSubstr("'60-'"));
  EXPECT_EQ(desk_->pages(), 0);
  EXPECT_TRUE(desk_->view()->image().isNull());
  Screenshot(window_.get(), "print_problem");
  EXPECT_FALSE(ClickAndWait("print.print"));
  EXPECT_EQ(Status(), "Nothing was printed.");
  EXPECT_TRUE(window_->problem()->isVisible());
  EXPECT_THAT(window_->problem()->sentence().toStdString(), HasSubstr("'60-'"));
  Change([&] { Type(desk_, "print.ids", "99999"); });
  EXPECT_THAT(Problem(), HasSubstr("99999"));
  Change([&] { Type(desk_, "print.ids", "100"); });
  EXPECT_EQ(Problem(), "");
  EXPECT_EQ(Status(), "");
  EXPECT_GT(desk_->pages(), 0);
  Change([&] { Choice("print.paper")->setCurrentText("quarto"); });
  EXPECT_THAT(Problem(), HasSubstr("quarto"));
  Choice("print.paper")->setCurrentText("A4");

  // An entry of the site's own file that says otherwise, and by its name.
  WriteFileAtomically(Path("tags.yaml").toStdString(), "family: tag36h11\nsizes_m:\n  100: 0.3\n");
  Change([&] { SetLength("print.size", 150); });
  EXPECT_THAT(Problem(), HasSubstr(Path("tags.yaml").toStdString()));
  EXPECT_FALSE(ClickAndWait("print.print"));
  EXPECT_FALSE(QFile::exists(Path("print/printed.csv")));

  SetLength("print.size", 300);
  ASSERT_TRUE(ClickAndWait("print.print")) << Status();  // cut into sheets, as it is listed
  SetLength("print.across", 40);
  EXPECT_FALSE(ClickAndWait("print.enter"));
  EXPECT_THAT(Status(), HasSubstr("--measured 40"));
  EXPECT_NEAR(ReadTagSizes(Path("tags.yaml").toStdString()).SizeOf(100), 0.3, 1e-9);
}

TEST_F(PrintDeskTest, BoardsAndScaleBars) {
  Change([&] { Choice("print.what")->setCurrentIndex(1); });
  EXPECT_FALSE(Child<QLineEdit>(desk_, "print.ids")->isVisible());
  EXPECT_TRUE(Child<QLineEdit>(desk_, "print.target")->isVisible());
  EXPECT_EQ(Problem(), "");
  Screenshot(window_.get(), "print_board");
  Change([&] { Type(desk_, "print.target", "checkerboard:9"); });
  EXPECT_THAT(Problem(), HasSubstr("checkerboard:9"));
  // A file of the site's folder.
  WriteFileAtomically(Path("board.yaml").toStdString(),
                      "target_type: checkerboard\ntargetCols: 6\ntargetRows: 5\nrowSpacingMeters: "
                      "0.03\ncolSpacingMeters: 0.03\n");
  Change([&] { Type(desk_, "print.target", "board.yaml"); });
  EXPECT_EQ(Problem(), "");
  ASSERT_TRUE(ClickAndWait("print.print")) << Status();
  EXPECT_TRUE(QFile::exists(Path("print/board_checkerboard_6x5_30mm.pdf")));
  EXPECT_TRUE(Child<QAbstractButton>(desk_, "print.open")->isEnabled());
  EXPECT_EQ(ReadTextFile(Path("tags.yaml").toStdString()), tags_);
  QFile::remove(Path("board.yaml"));

  Change([&] { Choice("print.what")->setCurrentIndex(2); });
  Type(desk_, "print.ids", "100,101");
  SetLength("print.size", 80);
  Choice("print.paper")->setCurrentText("A3");
  Change([&] { SetLength("print.length", 300); });
  EXPECT_EQ(Problem(), "");
  std::vector<int> seen;
  for (const TagDetection& tag : TagsOnPage()) seen.push_back(tag.id);
  EXPECT_THAT(seen, ElementsAre(100, 101));
  Screenshot(window_.get(), "print_scale_bar");
  ASSERT_TRUE(ClickAndWait("print.print")) << Status();
  EXPECT_THAT(Status(), HasSubstr("100,101,DISTANCE_M"));
}

TEST_F(PrintDeskTest, FilesAreChosenByADialog) {
  Click(desk_, "print.out_browse");
  ChoosePath(window_.get(), Path("sheets.pdf"));
  EXPECT_EQ(Child<QLineEdit>(desk_, "print.out")->text(), "sheets.pdf");
  EXPECT_THAT(Child<QLineEdit>(desk_, "print.command")->text().toStdString(),
              HasSubstr("--out " + Path("sheets.pdf").toStdString()));  // wherever it is typed
  EXPECT_FALSE(Child<QAbstractButton>(desk_, "print.target_browse")->isVisible());
  Choice("print.what")->setCurrentIndex(1);
  EXPECT_TRUE(Child<QAbstractButton>(desk_, "print.target_browse")->isVisible());
}

}  // namespace
}  // namespace trigpoint
