// 5,000 images, 1,000,000 points and 200 panoramas: memory, points that are drawn while the view moves and at rest. The
// project, which TRIGPOINT_GUI_LARGE names, is made by another program (desktop_open DIR): its memory does not count.
// Times are printed and not judged, since they depend on what else the machine does.
#include <QElapsedTimer>
#include <QMouseEvent>
#include <QSignalSpy>
#include <cstdio>
#include <fstream>
#include <string>

#include "eval/scene/scene_view.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

constexpr double kMostMemory_MiB = 800;
constexpr int kLoading_ms = 10 * kPatience;
constexpr int kRest_ms = 1000;  // after which all points are there again

double PeakMiB() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

void Mouse(QWidget* view, QEvent::Type type, const QPoint& at, Qt::MouseButton button, Qt::MouseButtons held) {
  QMouseEvent event(type, at, view->mapToGlobal(at), button, held, {});
  QApplication::sendEvent(view, &event);
}

void ExpectAllAtRest(const SceneDesk* scene) {
  QTest::qWait(kRest_ms);
  EXPECT_EQ(scene->PointsDrawn(), scene->PointsShown());
}

TEST(LargeProject, IsDrawnInBoundedMemoryWithManyPointsMovingAndAllAtRest) {
  const QString dir = qEnvironmentVariable("TRIGPOINT_GUI_LARGE");
  if (dir.isEmpty()) GTEST_SKIP() << "TRIGPOINT_GUI_LARGE names no project";
  QSettings().clear();
  const auto window = OpenWindow("");
  SceneDesk* scene = window->scene();
  window->ShowDesk("scene");
  QSignalSpy loaded(scene, &SceneDesk::Loaded);
  QElapsedTimer timer;
  timer.start();
  window->OpenProject(dir);
  ASSERT_TRUE(WaitFor([&] { return loaded.count() >= 1; }, kLoading_ms));
  QApplication::processEvents();
  std::printf("first picture after %.2f s\n", 1e-3 * static_cast<double>(timer.elapsed()));
  ASSERT_TRUE(WaitFor([&] { return loaded.count() >= 2; }, kLoading_ms));
  QApplication::processEvents();
  std::printf("all points after %.2f s\n", 1e-3 * static_cast<double>(timer.elapsed()));
  EXPECT_EQ(scene->PointsShown(), 1000000U);
  EXPECT_EQ(window->workspace()->snapshot()->references.size(), 200U);
  ExpectAllAtRest(scene);

  // Dragged: some of them in every picture until the button is let go.
  auto* view = Child<QWidget>(window.get(), "scene.view");
  const QPoint middle = view->rect().center();
  Mouse(view, QEvent::MouseButtonPress, middle, Qt::LeftButton, Qt::LeftButton);
  timer.restart();
  constexpr int kMoves = 10;
  for (int move = 1; move <= kMoves; ++move) {
    Mouse(view, QEvent::MouseMove, middle + QPoint(4 * move, move), Qt::NoButton, Qt::LeftButton);
    QApplication::processEvents();
    EXPECT_GE(scene->PointsDrawn(), size_t{SceneView::kMovingPoints});
    EXPECT_LT(scene->PointsDrawn(), scene->PointsShown());
  }
  std::printf("dragging: %.1f ms a picture\n", static_cast<double>(timer.elapsed()) / kMoves);
  Mouse(view, QEvent::MouseButtonRelease, middle + QPoint(4 * kMoves, kMoves), Qt::LeftButton, Qt::NoButton);
  ExpectAllAtRest(scene);

  // A selection is drawn at once with some of them.
  const QString object = QString::fromStdString("panorama:" + window->workspace()->snapshot()->references.front().name);
  timer.restart();
  window->workspace()->Select(object);
  EXPECT_GE(scene->PointsDrawn(), size_t{SceneView::kMovingPoints});
  ASSERT_TRUE(WaitFor([&] { return scene->Highlighted().contains(object); }));
  std::printf("selection until it is drawn: %.1f ms\n", static_cast<double>(timer.elapsed()));
  ExpectAllAtRest(scene);

  std::printf("peak memory %.0f MiB\n", PeakMiB());
#ifndef __SANITIZE_ADDRESS__  // which needs several times as much
  EXPECT_LE(PeakMiB(), kMostMemory_MiB);
#endif
}

}  // namespace
}  // namespace trigpoint
