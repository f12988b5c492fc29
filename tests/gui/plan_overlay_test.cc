// The plan's scale and grid over the scene.
#include <gtest/gtest.h>

#include <QImage>
#include <vector>

#include "app/desktop/scene_overlay.h"

namespace trigpoint {
namespace {

// Pixels of the plan's numbers: opaque and dark, as its lines are not.
int Inked(PlanOverlay* overlay, const std::vector<QRectF>& places) {
  QImage image(overlay->size(), QImage::Format_ARGB32);
  image.fill(Qt::transparent);
  overlay->render(&image, {}, {}, {});
  int inked = 0;
  for (const QRectF& place : places) {
    const QRect box = place.toAlignedRect() & image.rect();
    for (int y = box.top(); y <= box.bottom(); ++y) {
      for (int x = box.left(); x <= box.right(); ++x) {
        const QColor colour = image.pixelColor(x, y);
        inked += colour.alpha() > 240 && colour.lightness() < 60 ? 1 : 0;
      }
    }
  }
  return inked;
}

TEST(PlanOverlay, NumbersOfTheGridKeepOffTheLegend) {
  PlanOverlay overlay(nullptr);
  overlay.resize(600, 400);
  PlanFrame frame;
  frame.name = "site", frame.bar_px = 10;
  frame.a = {0.1, 0}, frame.b = {0, -0.1};  // 10 px a metre, north up
  frame.origin = {0, 39};
  overlay.SetFrame(frame);
  const QRectF line(5, 180, 220, 20), other(5, 202, 120, 20);
  const QRectF left(0, 0, 300, 330);  // above the bar
  const int inked = Inked(&overlay, {left});
  EXPECT_GT(Inked(&overlay, {line, other}), 10);
  frame.legend = {line, other};
  overlay.SetFrame(frame);
  EXPECT_EQ(Inked(&overlay, {line, other}), 0);
  EXPECT_NEAR(Inked(&overlay, {left}), inked, 0.1 * inked);  // beside it, not left out
}

// In every position of the grid the text of the bar is drawn on nothing else.
TEST(PlanOverlay, NumbersOfTheGridKeepOffTheBar) {
  PlanOverlay overlay(nullptr);
  overlay.resize(300, 200);
  PlanFrame frame;
  frame.name = "site", frame.bar_px = 10;
  frame.a = {0.1, 0}, frame.b = {0, -0.1};
  const QRectF text(0, 145, 100, 19);  // left of and in the bar's text
  int alone = -1;
  for (int at = 0; at < 40; ++at) {
    frame.origin = {0, 1000 + 0.5 * at};
    overlay.SetFrame(frame);
    const int inked = Inked(&overlay, {text});
    if (alone < 0) alone = inked;
    EXPECT_NEAR(inked, alone, 20) << at;
  }
}

}  // namespace
}  // namespace trigpoint
