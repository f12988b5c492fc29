// Runs the GUI tests in a real X server: the one of DISPLAY, or an Xvfb of its own that ends with it.
#include <QVTKOpenGLNativeWidget.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <QApplication>
#include <QDir>
#include <QSettings>
#include <QStandardPaths>
#include <QSurfaceFormat>
#include <QTemporaryDir>
#include <QThreadPool>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#ifdef __SANITIZE_ADDRESS__
// What plugins leave is reported when the process ends; by then their names would be gone with them.
extern "C" int dlclose(void*) { return 0; }
#endif

namespace {

// The process, or -1 where there is no Xvfb.
pid_t StartXvfb() {
  int ends[2];
  if (pipe(ends) != 0) return -1;
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    close(ends[0]);
    const std::string fd = std::to_string(ends[1]);
    // A window has as many pixels more as it is scaled.
    const int scale = std::max(1, static_cast<int>(std::lround(qEnvironmentVariable("QT_SCALE_FACTOR").toDouble())));
    const std::string screen = std::to_string(1600 * scale) + "x" + std::to_string(1000 * scale) + "x24";
    execlp("Xvfb", "Xvfb", "-displayfd", fd.c_str(), "-screen", "0", screen.c_str(), "-nolisten", "tcp",
           static_cast<char*>(nullptr));
    _exit(127);
  }
  close(ends[1]);
  std::string display;
  for (char c; read(ends[0], &c, 1) == 1 && c != '\n';) display += c;
  close(ends[0]);
  if (display.empty()) {
    waitpid(child, nullptr, 0);
    return -1;
  }
  setenv("DISPLAY", (":" + display).c_str(), 1);
  return child;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  pid_t server = 0;
  if (std::getenv("DISPLAY") == nullptr) server = StartXvfb();
  if (server < 0) {
    std::puts("skipped: neither an X server nor Xvfb is there");
    return 0;
  }
  setenv("QT_QPA_PLATFORM", "xcb", 1);
  setenv("QT_LOGGING_RULES", "qt.qpa.*=false", 0);
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 0);
  int code = 1;
  {
    QTemporaryDir settings;  // the user's own stay untouched
    QSettings::setDefaultFormat(QSettings::IniFormat);
    QSettings::setPath(QSettings::IniFormat, QSettings::UserScope, settings.path());
    QSurfaceFormat::setDefaultFormat(QVTKOpenGLNativeWidget::defaultFormat());
    QApplication::setAttribute(Qt::AA_DontUseNativeDialogs);  // the tests press their buttons
    QApplication app(argc, argv);
    QApplication::setOrganizationName("Trigpoint");
    QApplication::setApplicationName("gui_test");
    code = RUN_ALL_TESTS();
    QThreadPool::globalInstance()->waitForDone();
  }
  if (server > 0) {
    kill(server, SIGTERM);
    waitpid(server, nullptr, 0);
  }
  return code;
}
