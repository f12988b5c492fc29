// The images desk: panes as there is room, matches with lines, linked zoom, the images of a tag in turn, thumbnails,
// marks that are moved and removed.
#include <gmock/gmock.h>

#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QListWidget>
#include <QMenu>
#include <QMouseEvent>
#include <QSplitter>

#include "app/desktop/images_desk.h"
#include "app/desktop/match_lines.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/tag_images.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class ImagesTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    window_->ShowDesk("images");
    images_ = window_->images();
  }
  void Show(const QString& object) {
    ASSERT_TRUE(images_->ShowObject(object));
    ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && images_->left()->marks().size() > 2; }));
    images_->left()->Fit();
  }
  // The mark of a point in the image that is shown; null: none.
  const PictureMark* Mark(const QString& point) const {
    for (const PictureMark& mark : images_->left()->marks()) {
      if (mark.object == "mark:" + point) return &mark;
    }
    return nullptr;
  }
  std::string Marks() const {
    const QString file = Path("control_observations.csv");
    return QFile::exists(file) ? ReadTextFile(file.toStdString()) : "";
  }

  ImagesDesk* images_ = nullptr;
};

TEST_F(ImagesTest, PanesStandBesideOrBelowEachOtherAsThereIsRoom) {
  ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && !images_->right()->image().isNull(); }));
  const auto way = [&] { return qobject_cast<QSplitter*>(images_->left()->parentWidget())->orientation(); };
  window_->resize(1600, 640);
  EXPECT_TRUE(WaitFor([&] { return way() == Qt::Horizontal; }));
  Screenshot(window_.get(), "images_wide");
  window_->resize(1024, 980);
  EXPECT_TRUE(WaitFor([&] { return way() == Qt::Vertical; }));
  Screenshot(window_.get(), "images_high");
}

TEST_F(ImagesTest, TheImagesOfATagComeInTurnTheWorstResidualFirst) {
  // Tag 1 is seen in the images 6 and 9; the survey fits the first badly.
  WriteFileAtomically(Path("results/survey/residuals.csv").toStdString(),
                      "# trigpoint residuals 1\nrun,timestamp,image,camera,tag_id,status,rms_px\n"
                      "run1,1003,images/000006.jpg,cam0,1,used,0.9\nrun1,1004.5,images/000009.jpg,cam0,1,used,0.1\n");
  const Project& project = *window_->workspace()->snapshot()->project;
  const std::vector<TagImage> worst = ImagesOfTag(project, 1, TagImageOrder::kWorstResidual);
  ASSERT_EQ(worst.size(), 2u);
  EXPECT_EQ(worst[0].image, "run1/images/000006.jpg");
  EXPECT_EQ(*worst[0].rms_px, 0.9);
  EXPECT_GT(ImagesOfTag(project, 1, TagImageOrder::kLargest)[0].side_px, worst[0].side_px - 1e-9);
  window_->workspace()->Select("station:S1");
  auto* order = Child<QComboBox>(images_, "images.order");
  order->setCurrentIndex(order->findText("worst residual first"));
  const auto next = [&](const char* image) {
    Click(window_.get(), "images.next");
    return WaitFor([&] { return images_->image() == image; });
  };
  EXPECT_TRUE(next("images/000006.jpg"));
  EXPECT_EQ(window_->workspace()->selected(), "detection:run1/images/000006.jpg#1");
  EXPECT_TRUE(WaitFor([&] { return images_->left()->scale() > 3; }));  // on the tag
  EXPECT_TRUE(next("images/000009.jpg"));
  EXPECT_TRUE(next("images/000006.jpg"));  // round
  QDir(Path("results/survey")).removeRecursively();
}

// A part that is looked at is as large as its view has room for, and stays in its middle when the view changes.
TEST_F(ImagesTest, ATagIsNearInASmallViewAndStaysSo) {
  PictureView view;
  QImage picture(1280, 800, QImage::Format_RGB32);
  picture.fill(Qt::black);
  view.SetPicture(picture, "");
  view.resize(700, 700);
  view.show();
  const QRectF tag(900, 300, 80, 60);
  view.LookAt(tag);
  const auto seen = [&] { return QRectF(view.WidgetAt(tag.topLeft()), view.WidgetAt(tag.bottomRight())); };
  for (const auto& [size, side] :
       {std::pair(QSize(700, 700), 280), {{700, 400}, 240}, {{500, 250}, 200}, {{160, 120}, 96}, {{900, 800}, 320}}) {
    view.resize(size);
    ASSERT_TRUE(WaitFor([&] { return view.size() == size; }));
    EXPECT_NEAR(seen().width(), side, 1e-6) << size.width();
    EXPECT_LT((seen().center() - QPointF(0.5 * size.width(), 0.5 * size.height())).manhattanLength(), 1e-6);
  }
  // What was moved by hand stays where it is, and nothing is enlarged beyond use.
  QTest::keyClick(&view, Qt::Key_Minus);
  const double scale = view.scale();
  view.resize(700, 700);
  ASSERT_TRUE(WaitFor([&] { return view.width() == 700; }));
  EXPECT_EQ(view.scale(), scale);
  view.LookAt(QRectF(10, 10, 4, 4));
  EXPECT_EQ(view.scale(), 6);
}

TEST_F(ImagesTest, MarksAreSeenAtOnceMovedAndRemoved) {
  auto* point = Child<QComboBox>(images_, "images.point");
  point->setCurrentText("corner");
  Show("image:run1/images/000004.jpg");
  PictureView* view = images_->left();
  Click(window_.get(), "images.mark");
  QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt({60, 40}).toPoint());
  ASSERT_TRUE(WaitFor([&] { return Mark("corner") != nullptr; }));  // one mark is enough
  EXPECT_NEAR(Mark("corner")->points[0].x(), 60, 2);
  Screenshot(window_.get(), "images_mark");
  // Dragged to another place, and kept.
  const std::string written = Marks();
  const QPoint from = view->WidgetAt(Mark("corner")->points[0]).toPoint(), to = view->WidgetAt({90, 70}).toPoint();
  QTest::mousePress(view, Qt::LeftButton, {}, from);
  for (const QPoint& at : {(from + to) / 2, to}) {  // QTest moves the mouse without its button
    QMouseEvent move(QEvent::MouseMove, at, Qt::LeftButton, Qt::LeftButton, {});
    QApplication::sendEvent(view, &move);
  }
  QTest::mouseRelease(view, Qt::LeftButton, {}, to);
  ASSERT_TRUE(WaitFor([&] { return Mark("corner") != nullptr && std::abs(Mark("corner")->points[0].x() - 90) < 3; }));
  EXPECT_NEAR(Mark("corner")->points[0].y(), 70, 3);
  EXPECT_TRUE(WaitFor([&] { return Marks() != written; }));
  // It is of this image alone, and goes by the button.
  Show("image:run1/images/000005.jpg");
  EXPECT_TRUE(WaitFor([&] { return Mark("corner") == nullptr; }));
  Show("image:run1/images/000004.jpg");
  ASSERT_TRUE(WaitFor([&] { return Mark("corner") != nullptr; }));
  Click(window_.get(), "images.remove");
  EXPECT_TRUE(WaitFor([&] { return Mark("corner") == nullptr; }));
  EXPECT_EQ(Marks().find("corner"), std::string::npos);
  QFile::remove(Path("control_observations.csv"));
}

TEST_F(ImagesTest, RowsInSightHaveThumbnails) {
  auto* list = Child<QListWidget>(images_, "images.list");
  const auto drawn = [&](int row) {
    return list->item(row)->icon().pixmap(64, 48).toImage().pixelColor(32, 24).alpha() == 255;
  };
  EXPECT_TRUE(WaitFor([&] { return drawn(0) && drawn(2); }));
  EXPECT_GE(list->visualItemRect(list->item(0)).height(), 48);
}

TEST_F(ImagesTest, LinesLeadFromOnePictureToTheOther) {
  QWidget both;
  both.resize(400, 200);
  PictureView first(&both), second(&both);
  first.setGeometry(0, 0, 200, 200);
  second.setGeometry(200, 0, 200, 200);
  QImage picture(100, 100, QImage::Format_RGB32);
  picture.fill(Qt::black);
  first.SetPicture(picture, "");
  second.SetPicture(picture, "");
  MatchLines lines(&first, &second, &both);
  both.show();
  lines.SetPairs({{{10, 50}, {90, 50}, Qt::red}, {{50, 10}, {50, 10}, Qt::red}});
  EXPECT_EQ(lines.InSight(), 2);
  const QImage drawn = both.grab().toImage();
  const int y = static_cast<int>(first.WidgetAt({10, 50}).y());
  int reddest = 0;
  for (int dy = -2; dy <= 2; ++dy) {
    const QColor colour = drawn.pixelColor(200, y + dy);
    reddest = std::max(reddest, colour.red() - colour.blue());
  }
  EXPECT_GT(reddest, 60);
  // What is out of sight in one picture has no line.
  first.LookAt({10, 50}, 8);
  EXPECT_EQ(lines.InSight(), 1);
}

TEST_F(ImagesTest, ZoomIsLinkedByTheMatches) {
  ASSERT_TRUE(WaitFor([&] { return !images_->left()->image().isNull() && !images_->right()->image().isNull(); }));
  images_->lines()->SetPairs({{{40, 40}, {400, 100}, Qt::red}, {{250, 200}, {100, 200}, Qt::red}});
  Child<QCheckBox>(images_, "images.linked")->setChecked(true);
  images_->left()->LookAt({40, 40}, 10);
  PictureView* right = images_->right();
  const QPointF middle = right->PixelAt({0.5 * right->width(), 0.5 * right->height()});
  EXPECT_NEAR(middle.x(), 400, 2);
  EXPECT_NEAR(middle.y(), 100, 2);
  EXPECT_NEAR(right->scale() / right->FittedScale(), images_->left()->scale() / images_->left()->FittedScale(), 1e-6);
}

}  // namespace
}  // namespace trigpoint
