// How fast a large project opens: time to the first picture, time until all points are there, frames a second while the
// view turns, time from a selection until it is drawn, peak memory.
//
//   desktop_open DIR [IMAGES POINTS PANORAMAS]   DIR is made if it isn't there
#include <QVTKOpenGLNativeWidget.h>

#include <QApplication>
#include <QElapsedTimer>
#include <QSettings>
#include <QSignalSpy>
#include <QSurfaceFormat>
#include <QTemporaryDir>
#include <QTest>
#include <QThreadPool>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "app/desktop/main_window.h"
#include "app/desktop/scene_desk.h"
#include "tests/support/results_site.h"

namespace {

double PeakMiB() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmHWM:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

constexpr int kPatience = 600000;  // ms

bool WaitFor(const std::function<bool()>& condition) { return QTest::qWaitFor(condition, kPatience); }

// From a selection until the scene is drawn with its ring.
void PrintSelections(trigpoint::MainWindow& window) {
  const auto& panoramas = window.workspace()->snapshot()->references;
  std::vector<double> times_ms;
  for (size_t i = 0; i < panoramas.size(); i += std::max<size_t>(1, panoramas.size() / 20)) {
    const QString object = QString::fromStdString("panorama:" + panoramas[i].name);
    QElapsedTimer timer;
    timer.start();
    window.workspace()->Select(object);
    WaitFor([&] { return window.scene()->Highlighted().contains(object); });
    QApplication::processEvents(QEventLoop::ExcludeUserInputEvents);
    times_ms.push_back(1e-6 * static_cast<double>(timer.nsecsElapsed()));
  }
  std::sort(times_ms.begin(), times_ms.end());
  if (times_ms.empty()) return;
  std::printf("selection until it is drawn: median %.1f ms, largest %.1f ms of %zu\n", times_ms[times_ms.size() / 2],
              times_ms.back(), times_ms.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::puts("desktop_open DIR [IMAGES POINTS PANORAMAS]");
    return 2;
  }
  const std::string dir = argv[1];
  if (!std::filesystem::exists(dir)) {
    trigpoint::ResultsSiteSize size;
    size.images = argc > 2 ? std::atoi(argv[2]) : 5000;
    size.points = argc > 3 ? std::atoi(argv[3]) : 1000000;
    size.panoramas = argc > 4 ? std::atoi(argv[4]) : 200;
    size.image_width = 960, size.image_height = 600, size.panorama_width = 4096;
    trigpoint::WriteResultsSite(dir, size);
    std::puts("made");
    return 0;
  }
  const QTemporaryDir settings;
  QSettings::setDefaultFormat(QSettings::IniFormat);
  QSettings::setPath(QSettings::IniFormat, QSettings::UserScope, settings.path());
  QSurfaceFormat::setDefaultFormat(QVTKOpenGLNativeWidget::defaultFormat());
  QElapsedTimer timer;
  timer.start();
  QApplication app(argc, argv);
  QApplication::setOrganizationName("Trigpoint");
  {
    trigpoint::MainWindow window;
    window.show();
    window.ShowDesk("scene");
    QSignalSpy loaded(window.scene(), &trigpoint::SceneDesk::Loaded);
    window.OpenProject(QString::fromStdString(dir));
    WaitFor([&] { return loaded.count() >= 1; });
    QApplication::processEvents();
    std::printf("first picture after %.2f s\n", 1e-3 * static_cast<double>(timer.elapsed()));
    std::printf("peak memory until then %.0f MiB\n", PeakMiB());
    WaitFor([&] { return loaded.count() >= 2; });
    QApplication::processEvents();
    std::printf("all points after %.2f s\n", 1e-3 * static_cast<double>(timer.elapsed()));
    const std::clock_t begun = std::clock();
    std::vector<double> frames = window.scene()->Turn(100);
    const double busy_ms = 1e3 * static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC / 100;
    std::sort(frames.begin(), frames.end());
    const double median = frames[frames.size() / 2], slow = frames[frames.size() * 9 / 10];
    std::printf("turning: median %.1f ms a frame (%.1f a second), 90 %% within %.1f ms, %.1f ms of processor time\n",
                median, 1e3 / median, slow, busy_ms);
    PrintSelections(window);
    std::printf("peak memory %.0f MiB\n", PeakMiB());
  }
  QThreadPool::globalInstance()->waitForDone();
  return 0;
}
