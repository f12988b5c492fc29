// Pictures of every desk on a project with results, for docs/pictures and for looking at.
//
//   desktop_pictures DIR OUT [STATION [WIDTHxHEIGHT [THEME [LANGUAGE]]]]   in an X server, such as that of xvfb-run
#include <QVTKOpenGLNativeWidget.h>

#include <QAbstractButton>
#include <QApplication>
#include <QComboBox>
#include <QListWidget>
#include <QSettings>
#include <QSignalSpy>
#include <QSurfaceFormat>
#include <QTabWidget>
#include <QTableWidget>
#include <QTemporaryDir>
#include <QTest>
#include <QThreadPool>
#include <QTranslator>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "app/desktop/charts_desk.h"
#include "app/desktop/compare_desk.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/main_window.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/tables_desk.h"

namespace {

constexpr int kPatience = 120000;    // ms
constexpr int kMayBeMissing = 8000;  // for what a site need not have

void Save(trigpoint::MainWindow& window, const QString& out, const char* name) {
  QTest::qWait(1500);
  const QString file = out + "/" + name + ".png";
  if (!window.grab().save(file)) std::fprintf(stderr, "%s: cannot be written\n", qPrintable(file));
}

// Whatever comes of it: what is missing is seen in the picture.
bool WaitFor(const std::function<bool()>& condition, int patience_ms = kPatience) {
  return QTest::qWaitFor(condition, patience_ms);
}

void SaveCharts(trigpoint::MainWindow& window, const QString& out) {
  window.ShowDesk("charts");
  if (auto* charts = window.findChild<QListWidget*>("charts.list")) {
    WaitFor([&] { return charts->count() > 0; });
    for (const char* name : {"by_station_single-against-control-absolute", "camera_errors_1", "tag_residuals"}) {
      if (window.charts()->Choose(name)) Save(window, out, name);
    }
    charts->setCurrentRow(0);
    Save(window, out, "charts");
  }
}

void SaveComparison(trigpoint::MainWindow& window, const QString& out) {
  window.ShowDesk("compare");
  if (auto* second = window.findChild<QComboBox*>("compare.b")) second->setCurrentIndex(0);
  auto* a = window.findChild<QComboBox*>("compare.run_a");
  auto* b = window.findChild<QComboBox*>("compare.run_b");
  if (a != nullptr && b != nullptr && a->count() > 2) {
    a->setCurrentIndex(1);
    b->setCurrentIndex(2);
  }
  if (auto* errors = window.findChild<QTableWidget*>("compare.errors")) {
    WaitFor([&] { return errors->rowCount() > 0; });
  }
  Save(window, out, "compare");
  if (auto* tabs = window.compare()->findChild<QTabWidget*>()) {
    for (int i = 1; i < tabs->count(); ++i) {
      tabs->setCurrentIndex(i);
      if (i + 1 == tabs->count()) {
        std::vector<std::unique_ptr<QSignalSpy>> drawn;
        for (auto* scene : window.compare()->findChildren<trigpoint::SceneDesk*>()) {
          drawn.push_back(std::make_unique<QSignalSpy>(scene, &trigpoint::SceneDesk::Loaded));
        }
        WaitFor([&] {  // twice: the points follow the rest
          return std::all_of(drawn.begin(), drawn.end(), [](const auto& spy) { return spy->count() >= 2; });
        });
      }
      Save(window, out, qPrintable(QString("compare_%1").arg(i)));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::puts("desktop_pictures DIR OUT [STATION [WIDTHxHEIGHT [THEME [LANGUAGE]]]]");
    return 2;
  }
  const QTemporaryDir settings;
  QSettings::setDefaultFormat(QSettings::IniFormat);
  QSettings::setPath(QSettings::IniFormat, QSettings::UserScope, settings.path());
  QSurfaceFormat::setDefaultFormat(QVTKOpenGLNativeWidget::defaultFormat());
  QApplication app(argc, argv);
  QApplication::setOrganizationName("Trigpoint");
  QTranslator translator;
  if (argc > 6 && translator.load(QString("trigpoint_") + argv[6], app.applicationDirPath() + "/../share/trigpoint")) {
    QApplication::installTranslator(&translator);
  }
  const QString out = argv[2];
  std::filesystem::create_directories(argv[2]);
  {
    trigpoint::MainWindow window;
    const QString size = argc > 4 ? argv[4] : "1280x800";
    window.resize(size.section('x', 0, 0).toInt(), size.section('x', 1, 1).toInt());
    if (argc > 5) window.SetTheme(argv[5]);
    window.show();
    Save(window, out, "welcome");
    window.OpenProject(argv[1]);
    if (!WaitFor([&] { return window.workspace()->snapshot() != nullptr; })) return 1;
    const auto& stations = window.workspace()->snapshot()->stations;
    const QString station = argc > 3 ? argv[3] : stations.empty() ? "" : stations.front().name.c_str();
    WaitFor([&] { return window.overview()->overview() != nullptr; });
    window.workspace()->Select("station:" + station);
    Save(window, out, "overview");
    window.ShowDesk("run");
    window.run_desk()->Choose("localize", "");
    Save(window, out, "run");
    QSignalSpy loaded(window.scene(), &trigpoint::SceneDesk::Loaded);
    window.ShowDesk("scene");
    WaitFor([&] { return loaded.count() >= 2; });
    window.workspace()->Select("station:" + station);
    Save(window, out, "scene");
    if (auto* shading = window.scene()->findChild<QAbstractButton*>("scene.edl")) {
      shading->setChecked(true);
      Save(window, out, "shaded");
      shading->setChecked(false);
    }
    window.scene()->SetMode("plan");
    Save(window, out, "plan");
    window.scene()->SetMode("orbit");
    for (const std::string& object : window.workspace()->related()) {
      if (object.rfind("panorama:", 0) != 0) continue;
      QSignalSpy inside(window.scene(), &trigpoint::SceneDesk::SteppedInside);
      if (window.scene()->StepInside(QString::fromStdString(object.substr(9)))) {
        WaitFor([&] { return inside.count() > 0; });
        Save(window, out, "inside");
        window.scene()->StepOutside();
      }
      break;
    }
    window.ShowDesk("images");
    window.images()->ShowObject("station:" + station);
    WaitFor([&] { return window.images()->left()->scale() > 4; }, kMayBeMissing);
    Save(window, out, "tag");
    window.images()->left()->Fit();
    if (auto* match = window.findChild<QAbstractButton*>("images.match")) {
      QTest::mouseClick(match, Qt::LeftButton);
      WaitFor([&] { return !window.images()->right()->marks().empty(); }, kMayBeMissing);
    }
    Save(window, out, "images");
    window.ShowDesk("tables");
    window.tables()->Choose("evaluate/errors");
    Save(window, out, "tables");
    SaveCharts(window, out);
    SaveComparison(window, out);
    for (const char* desk : {"review", "panoramas", "calibration", "plan", "print", "check"}) {
      window.ShowDesk(desk);
      if (auto* photos = window.findChild<QTableWidget*>("panorama.photos"); desk == std::string("panoramas")) {
        auto* box = window.findChild<QComboBox*>("panorama.set");
        if (const int set = box->findText("(photo set)", Qt::MatchContains); set >= 0) box->setCurrentIndex(set);
        WaitFor([&] { return photos->rowCount() > 0; }, kMayBeMissing);
      }
      Save(window, out, desk == std::string("plan") ? "survey_plan" : desk);
    }
    if (argc > 5) return 0;
    window.SetTheme("dark");
    window.ShowDesk("tables");
    Save(window, out, "dark");
    window.ShowDesk("scene");
    Save(window, out, "dark_scene");
  }
  QThreadPool::globalInstance()->waitForDone();
  return 0;
}
