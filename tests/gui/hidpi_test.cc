// What is seen, and what is under the mouse, at any scale of the screen: desktop_hidpi_test runs these, and others that
// click on pictures and in the scene, at two pixels of the screen to a pixel of the window.
#include <QComboBox>
#include <QImage>
#include <algorithm>

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
  // In the middle of each side its line: green, where it is not smoothed.
  for (int k = 0; k < 4; ++k) {
    const QPoint at = (ratio * view->WidgetAt(0.5 * (corners[k] + corners[(k + 1) % 4]))).toPoint();
    int greenest = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const QColor colour = drawn.pixelColor(at + QPoint(dx, dy));
        greenest = std::max(greenest, colour.green() - std::max(colour.red(), colour.blue()));
      }
    }
    EXPECT_GT(greenest, 80) << k;
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
  // What the selection changes in the view lies round the panorama, once nothing else changes there any more.
  QRect changed;
  const auto near = [&] {
    window_->workspace()->Select("");
    const QImage without = view->grab().toImage();
    window_->workspace()->Select(panorama);
    const QImage with = view->grab().toImage();
    EXPECT_EQ(with.size(), view->size() * ratio);
    changed = {};
    for (int y = 0; y < with.height(); ++y) {
      for (int x = 0; x < with.width(); ++x) {
        if (with.pixel(x, y) != without.pixel(x, y)) changed |= QRect(x, y, 1, 1);
      }
    }
    return (QRectF(changed).center() - place()).manhattanLength() < 10 * ratio;
  };
  EXPECT_TRUE(WaitFor(near)) << changed.x() << " " << changed.y() << " " << changed.width() << " " << changed.height();
  EXPECT_GT(changed.width(), 10 * ratio);
}

}  // namespace
}  // namespace trigpoint
