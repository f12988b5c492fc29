// trigpoint-desktop [DIR]
#include <QVTKOpenGLNativeWidget.h>

#include <QApplication>
#include <QCommandLineParser>
#include <QLocale>
#include <QSurfaceFormat>
#include <QThreadPool>
#include <QTranslator>

#include "app/desktop/main_window.h"

int main(int argc, char** argv) {
  QSurfaceFormat::setDefaultFormat(QVTKOpenGLNativeWidget::defaultFormat());  // before the application
  QApplication::setAttribute(Qt::AA_EnableHighDpiScaling);
  QApplication::setAttribute(Qt::AA_UseHighDpiPixmaps);
  QApplication app(argc, argv);
  QApplication::setOrganizationName("Trigpoint");
  QApplication::setApplicationName("trigpoint-desktop");
  QApplication::setApplicationVersion(TRIGPOINT_VERSION);
  QTranslator translator;
  if (translator.load(QLocale(), "trigpoint", "_", QApplication::applicationDirPath() + "/../share/trigpoint")) {
    QApplication::installTranslator(&translator);
  }
  QCommandLineParser parser;
  parser.setApplicationDescription(QApplication::translate("main", "Trigpoint's workstation."));
  parser.addHelpOption();
  parser.addVersionOption();
  parser.addPositionalArgument("DIR", QApplication::translate("main", "the project; default: that of the last session"),
                               "[DIR]");
  parser.process(app);
  int code = 0;
  {
    trigpoint::MainWindow window;
    window.show();
    if (parser.positionalArguments().isEmpty()) {
      window.RestoreSession();
    } else {
      window.OpenProject(parser.positionalArguments().first());
    }
    code = QApplication::exec();
  }
  QThreadPool::globalInstance()->waitForDone();
  return code;
}
