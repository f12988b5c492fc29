// What is seen, and what is under the mouse, at any scale of the screen: desktop_hidpi_test runs these, and others that
// click on pictures and in the scene, at two pixels of the screen to a pixel of the window.
#include <QComboBox>
#include <QImage>

#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

class HiDpiTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    const QString factor = qEnvironmentVariable("QT_SCALE_FACTOR", "1");
    ASSERT_EQ(window_->devicePixelRatioF(), factor.toDouble());
  }
};

TEST_F(HiDpiTest, APictureIsDrawnInThePixelsOfTheScreenAndClickedWhereItIs) {
  window_->ShowDesk("images");
  PictureView* view = window_->images()->left();
  ASSERT_TRUE(window_->images()->ShowObject("detection:run1/images/000006.jpg#1"));
  ASSERT_TRUE(WaitFor([&] { return view->scale() > 3; }));
  const auto of = [&]() -> const PictureMark* {
    for (const PictureMark& mark : view->marks()) {
      if (mark.object == "detection:run1/images/000006.jpg#1") return &mark;
    }
    return nullptr;
  };
  ASSERT_NE(of(), nullptr);
  window_->workspace()->Select("");
  const QPolygonF corners = of()->points;
  const double ratio = view->devicePixelRatioF();
  const QImage drawn = view->grab().toImage();
  ASSERT_EQ(drawn.size(), view->size() * ratio);
  // In the middle of each side its line: green.
  for (int k = 0; k < 4; ++k) {
    const QPointF at = ratio * view->WidgetAt(0.5 * (corners[k] + corners[(k + 1) % 4]));
    const QColor colour = drawn.pixelColor(at.toPoint());
    EXPECT_GT(colour.green() - std::max(colour.red(), colour.blue()), 100) << k;
  }
  const QPointF middle = 0.5 * (corners[0] + corners[2]);
  QTest::mouseClick(view, Qt::LeftButton, {}, view->WidgetAt(middle).toPoint());
  EXPECT_EQ(window_->workspace()->selected(), "detection:run1/images/000006.jpg#1");
}

TEST_F(HiDpiTest, TheSceneIsClickedWhereItIsDrawnAndTheRingIsThere) {
  ShowScene();
  SceneDesk* scene = window_->scene();
  scene->SetMode("plan");
  auto* view = Child<QWidget>(window_.get(), "scene.view");
  const double ratio = view->devicePixelRatioF();
  const QString panorama = "panorama:panoramas/p002.jpg";
  const auto place = [&] { return scene->PlaceOf(panorama); };  // in pixels of the screen
  ASSERT_TRUE(WaitFor([&] { return place().x() > 0; }));
  QTest::mouseClick(view, Qt::LeftButton, {}, (place() / ratio).toPoint());
  EXPECT_TRUE(window_->workspace()->related().count(panorama.toStdString()) > 0)
      << window_->workspace()->selected().toStdString();
  // What the selection changes in the view lies round the panorama.
  window_->workspace()->Select("");
  QTest::qWait(50);
  const QImage without = view->grab().toImage();
  ASSERT_EQ(without.size(), view->size() * ratio);
  const QPointF before = place();
  window_->workspace()->Select(panorama);
  QTest::qWait(50);
  const QImage with = view->grab().toImage();
  ASSERT_EQ(with.size(), without.size());
  ASSERT_LT((place() - before).manhattanLength(), 1);
  QRect changed;
  for (int y = 0; y < with.height(); ++y) {
    for (int x = 0; x < with.width(); ++x) {
      if (with.pixel(x, y) != without.pixel(x, y)) changed |= QRect(x, y, 1, 1);
    }
  }
  EXPECT_LT((QRectF(changed).center() - before).manhattanLength(), 10 * ratio)
      << changed.x() << " " << changed.y() << " " << changed.width() << " " << changed.height();
  EXPECT_GT(changed.width(), 10 * ratio);
}

}  // namespace
}  // namespace trigpoint
