// Every desk on a small project whose results are in place.
#include <gmock/gmock.h>

#include <QAbstractButton>
#include <QAbstractSpinBox>
#include <QAction>
#include <QApplication>
#include <QCheckBox>
#include <QClipboard>
#include <QComboBox>
#include <QDragEnterEvent>
#include <QLabel>
#include <QListWidget>
#include <QMimeData>
#include <QScrollBar>
#include <QSettings>
#include <QSignalSpy>
#include <QSlider>
#include <QTabBar>
#include <QTableView>
#include <QTableWidget>
#include <QTemporaryDir>
#include <QTextBrowser>
#include <QTextFrame>
#include <QTranslator>

#include "app/desktop/column_format.h"
#include "app/desktop/column_help.h"
#include "app/desktop/compare_desk.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/overview_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/scene_desk.h"
#include "app/desktop/site_tree.h"
#include "app/desktop/tables_desk.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class DesksTest : public ResultsWindowTest {};

TEST_F(DesksTest, TreeListsTheSiteAndTheStatesOfResults) {
  SiteTree* tree = window_->tree();
  for (const char* text : {"run1", "images/000003.jpg", "panoramas/p002.jpg", "S2"}) {
    EXPECT_FALSE(tree->findItems(text, Qt::MatchExactly | Qt::MatchRecursive).isEmpty()) << text;
  }
  EXPECT_TRUE(WaitFor([&] { return tree->StateOf("features/run1") == "missing"; }));
  EXPECT_TRUE(window_->RecentProjects().contains(site_->path()));
  Screenshot(window_.get(), "site");
}

TEST_F(DesksTest, StationPickedInTheTableIsHighlightedInTheSceneAndBack) {
  ShowScene();
  ShowErrors();
  ClickRow(view_, RowWith(view_, "S2"));
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  EXPECT_TRUE(window_->scene()->Highlighted().contains("station:S2"));
  EXPECT_TRUE(window_->scene()->Highlighted().contains("panorama:panoramas/p002.jpg"));
  Screenshot(window_.get(), "tables");
  // Back: what is clicked in the scene is selected in the table.
  window_->ShowDesk("scene");
  window_->scene()->SetMode("plan");
  QTest::qWait(200);
  for (const char* layer : {"points", "labels", "errors", "ellipsoids"}) {
    for (QListWidgetItem* item :
         Child<QListWidget>(window_.get(), "scene.layers")->findItems(layer, Qt::MatchExactly)) {
      item->setCheckState(Qt::Unchecked);
    }
  }
  const QPointF at = window_->scene()->PlaceOf("panorama:panoramas/p001.jpg");
  ASSERT_GT(at.x(), 0);
  QWidget* scene = Child<QWidget>(window_.get(), "scene.view");
  QTest::mouseClick(scene, Qt::LeftButton, {}, (at / scene->devicePixelRatioF()).toPoint());
  EXPECT_TRUE(window_->workspace()->selected().contains("p001")) << window_->workspace()->selected().toStdString();
  window_->ShowDesk("tables");
  EXPECT_TRUE(WaitFor([&] {
    return view_->currentIndex().isValid() &&
           view_->currentIndex().data(DataTableModel::kObjectRole).toString() == "station:S1";
  }));
}

TEST_F(DesksTest, SceneLayersMeasureScreenshotAndSteppingInside) {
  ShowScene();
  SceneDesk* scene = window_->scene();
  ASSERT_TRUE(WaitFor([&] {
    return !Child<QListWidget>(window_.get(), "scene.layers")->findItems("points", Qt::MatchExactly).isEmpty();
  }));
  Screenshot(window_.get(), "scene");
  const QImage with = scene->Screenshot(640, 360);
  EXPECT_EQ(with.size(), QSize(640, 360));
  auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
  layers->findItems("points", Qt::MatchExactly).front()->setCheckState(Qt::Unchecked);
  EXPECT_NE(scene->Screenshot(640, 360), with);
  scene->SetMode("plan");
  for (const char* layer : {"labels", "errors", "ellipsoids", "geotags"}) {
    for (QListWidgetItem* item : layers->findItems(layer, Qt::MatchExactly)) item->setCheckState(Qt::Unchecked);
  }
  auto* measure = Child<QCheckBox>(window_.get(), "scene.measure");
  measure->setChecked(true);
  // The list of measurements takes room once it has one: places are asked for anew.
  const auto pick = [&](const char* panorama) {
    const QPointF at = scene->PlaceOf(panorama);
    return scene->PickAt(at.x(), at.y());
  };
  pick("panorama:panoramas/p000.jpg");
  const QString said = pick("panorama:panoramas/p002.jpg");
  EXPECT_THAT(said.toStdString(), HasSubstr("3.600 m"));  // 24 images x 0.3 m / 4 panoramas x 2
  measure->setChecked(false);
  window_->workspace()->SetUnit("ft");
  measure->setChecked(true);
  pick("panorama:panoramas/p000.jpg");
  EXPECT_THAT(pick("panorama:panoramas/p002.jpg").toStdString(), HasSubstr("11.811 ft"));
  measure->setChecked(false);
  scene->SetMode("orbit");
  window_->workspace()->Select("station:S1");
  QSignalSpy inside(scene, &SceneDesk::SteppedInside);
  Click(window_.get(), "scene.inside");
  EXPECT_TRUE(WaitFor([&] { return inside.count() == 1; }));
  EXPECT_TRUE(scene->inside());
  Screenshot(window_.get(), "inside");
  Click(window_.get(), "scene.inside");
  EXPECT_FALSE(scene->inside());
}

TEST_F(DesksTest, TableSortsFiltersCopiesExportsAndShowsFeet) {
  ShowErrors();
  const auto column = [&](const QString& name) {
    for (int c = 0; c < view_->model()->columnCount(); ++c) {
      if (view_->model()->headerData(c, Qt::Horizontal).toString() == name) return c;
    }
    return -1;
  };
  view_->sortByColumn(column("error_3d (m)"), Qt::DescendingOrder);
  EXPECT_EQ(view_->model()->index(0, column("station")).data().toString(), "S3");
  ClickRow(view_, 0);
  Click(window_.get(), "tables.copy");
  EXPECT_THAT(QApplication::clipboard()->text().toStdString(), HasSubstr("S3\tpanoramas/p003.jpg"));
  window_->workspace()->SetUnit("ft");
  EXPECT_EQ(view_->model()->index(0, column("error_3d (ft)")).data().toDouble(), 0.1312);
  Type(window_.get(), "tables.filter", "p001");
  EXPECT_EQ(view_->model()->rowCount(), 1);
  Type(window_.get(), "tables.filter", "RUN1 p001");  // words of one row, in cells of their own
  EXPECT_EQ(view_->model()->rowCount(), 1);
  Type(window_.get(), "tables.filter", "p001 p002");
  EXPECT_EQ(view_->model()->rowCount(), 0);
  Type(window_.get(), "tables.filter", "p001");
  const QTemporaryDir out;
  window_->tables()->Export(out.filePath("errors.csv"));
  const std::string text = ReadTextFile(out.filePath("errors.csv").toStdString());
  EXPECT_THAT(text, HasSubstr("p001.jpg"));
  EXPECT_THAT(text, HasSubstr("0.0200"));  // metres, whatever is shown
  EXPECT_THAT(text, testing::Not(HasSubstr("p002.jpg")));
}

TEST_F(DesksTest, TablesStandInATreeWithUnitsColoursAndBlanksLast) {
  WriteFileAtomically(Path("results/evaluate/extra.csv").toStdString(),
                      "# trigpoint extra 1\nstation,error_3d_m,heading_deg,left_m\n"
                      "S0,0.02,1.23456789,3\nS9,,2,0.00001\nS10,1.5,-3,2\n");
  window_->workspace()->Reload();
  window_->ShowDesk("tables");
  TablesDesk* tables = window_->tables();
  ASSERT_TRUE(WaitFor([&] { return tables->Choose("evaluate/extra"); }));
  view_ = Child<QTableView>(window_.get(), "tables.view");
  ASSERT_TRUE(WaitFor([&] { return view_->model()->columnCount() == 4; }));
  const auto header = [&](int c) { return view_->model()->headerData(c, Qt::Horizontal).toString().toStdString(); };
  EXPECT_EQ(header(1), "error_3d (m)");
  EXPECT_EQ(header(2), "heading (deg)");
  const auto column = [&](int c) {
    QStringList all;
    for (int row = 0; row < view_->model()->rowCount(); ++row) all << view_->model()->index(row, c).data().toString();
    return all.join(' ').toStdString();
  };
  EXPECT_EQ(column(2), "1.2346 2.0000 -3.0000");
  EXPECT_EQ(column(3), "3.0000 1e-05 2.0000");  // never a zero that is none
  view_->sortByColumn(1, Qt::AscendingOrder);
  EXPECT_EQ(column(0), "S0 S10 S9");
  view_->sortByColumn(0, Qt::AscendingOrder);
  EXPECT_EQ(column(0), "S0 S9 S10");
  view_->sortByColumn(1, Qt::DescendingOrder);
  EXPECT_EQ(column(0), "S10 S0 S9");
  const auto colour = [&](int row) { return view_->model()->index(row, 1).data(Qt::BackgroundRole); };
  EXPECT_TRUE(colour(0).isValid());
  EXPECT_NE(colour(0), colour(1));
  EXPECT_FALSE(colour(2).isValid());
  EXPECT_EQ(tables->ExportName(), "evaluate_extra.csv");
  tables->ShowColumn("heading_deg", false);
  EXPECT_TRUE(view_->isColumnHidden(2));
  ClickRow(view_, 0);
  EXPECT_THAT(tables->SelectionAsText().toStdString(), testing::Not(HasSubstr("heading")));
  Screenshot(window_.get(), "tables_tree");
  // Another table keeps it hidden, and a reload the table.
  window_->workspace()->Reload();
  QTest::qWait(200);
  EXPECT_TRUE(WaitFor([&] { return view_->model()->columnCount() == 4 && view_->isColumnHidden(2); }));
  QFile::remove(Path("results/evaluate/extra.csv"));
}

TEST(ColumnFormat, ADriftForEachMetreIsNoLength) {
  const DisplayUnit feet{"ft", 0.3048};
  const ColumnFormat drift = FormatOf("heading_drift_deg_m", true);
  EXPECT_EQ(drift.Header(feet), QString("heading_drift (deg/m)"));
  EXPECT_EQ(drift.Cell("0.25", feet), QString("0.2500"));
  const ColumnFormat length = FormatOf("repeatability_m", true);
  EXPECT_EQ(length.Header(feet), QString("repeatability (ft)"));
  EXPECT_EQ(length.Cell("0.6096", feet), QString("2.0000"));
}

TEST_F(DesksTest, ResidualLeadsToItsImageAndThePixel) {
  ImagesDesk* images = window_->images();
  window_->ShowDesk("images");
  EXPECT_TRUE(images->ShowObject("detection:run1/images/000006.jpg#1"));
  PictureView* picture = images->left();
  EXPECT_TRUE(WaitFor([&] { return !picture->marks().empty() && !picture->image().isNull(); }));
  EXPECT_EQ(images->image(), "images/000006.jpg");
  EXPECT_TRUE(WaitFor([&] { return picture->scale() > 5; }));  // on the tag
  int tracks = 0;
  for (const PictureMark& mark : picture->marks()) tracks += mark.layer == "tracks" ? 1 : 0;
  EXPECT_GT(tracks, 20);
  EXPECT_THAT(Child<QLabel>(images, "images.status")->text().toStdString(), HasSubstr("reprojection RMS 0."));
  Screenshot(window_.get(), "images");
  picture->setFocus();
  QTest::keyClick(picture, Qt::Key_0);
  const double fitted = picture->scale();
  QTest::keyClick(picture, Qt::Key_Plus);
  EXPECT_GT(picture->scale(), fitted);
  // A click on the tag selects it.
  QTest::keyClick(picture, Qt::Key_0);
  QTest::mouseClick(picture, Qt::LeftButton, {}, picture->WidgetAt({0.4 * 320 + 5, 0.4 * 240 + 5}).toPoint());
  EXPECT_EQ(window_->workspace()->selected(), "detection:run1/images/000006.jpg#1");
}

TEST_F(DesksTest, PointMarkedInTwoImagesIsPredictedInTheOthers) {
  window_->ShowDesk("images");
  ImagesDesk* images = window_->images();
  PictureView* picture = images->left();
  auto* point = Child<QComboBox>(images, "images.point");
  point->setCurrentText("P1");
  // A place 10 m ahead of the first camera, 1 m to the right; f = 256 px.
  const auto pixel = [](int image) { return QPointF(159.5 + 256 * 1 / (10 - 0.3 * image), 119.5); };
  for (const int image : {0, 8}) {
    ASSERT_TRUE(images->ShowObject(QString("image:run1/images/%1.jpg").arg(image, 6, 10, QChar('0'))));
    ASSERT_TRUE(WaitFor([&] { return !picture->image().isNull() && picture->marks().size() > 2; }));
    picture->Fit();
    Click(images, "images.mark");
    QTest::mouseClick(picture, Qt::LeftButton, {}, picture->WidgetAt(pixel(image)).toPoint());
    QTest::qWait(300);
  }
  ASSERT_TRUE(images->ShowObject("image:run1/images/000004.jpg"));
  auto* confirm = Child<QAbstractButton>(images, "images.confirm");
  ASSERT_TRUE(WaitFor([&] { return confirm->isEnabled(); }));
  QPointF predicted;
  for (const PictureMark& mark : picture->marks()) {
    if (mark.layer == "marks") predicted = mark.points[0];
  }
  EXPECT_NEAR(predicted.x(), pixel(4).x(), 2);
  EXPECT_NEAR(predicted.y(), pixel(4).y(), 2);
  QTest::mouseClick(confirm, Qt::LeftButton);
  EXPECT_TRUE(WaitFor([&] {
    return ReadTextFile(Path("control_observations.csv").toStdString()).find("000004.jpg") != std::string::npos;
  }));
  QFile::remove(Path("control_observations.csv"));
}

TEST_F(DesksTest, ReviewExcludesAndUndoesWithReason) {
  window_->ShowDesk("review");
  QSignalSpy reviewed(window_->review(), &ReviewDesk::Reviewed);
  window_->workspace()->Select("station:S2");
  EXPECT_EQ(Child<QLineEdit>(window_.get(), "review.object")->text(), "station:S2");
  Click(window_.get(), "review.exclude");
  ASSERT_TRUE(WaitFor([&] { return window_->problem()->isVisible(); }));
  EXPECT_THAT(window_->problem()->sentence().toStdString(), HasSubstr("reason"));
  Type(window_.get(), "review.reason", "tag was moved");
  Type(window_.get(), "review.user", "anna");
  Click(window_.get(), "review.exclude");
  ASSERT_TRUE(WaitFor([&] { return reviewed.count() == 1; }));
  EXPECT_FALSE(window_->problem()->isVisible());
  const std::string file = ReadTextFile(Path("review.jsonl").toStdString());
  for (const char* part : {"tag was moved", "anna", "station:S2", "exclude"}) EXPECT_THAT(file, HasSubstr(part));
  auto* entries = Child<QTableWidget>(window_.get(), "review.entries");
  EXPECT_EQ(entries->rowCount(), 1);
  EXPECT_EQ(window_->workspace()->snapshot()->excluded.count("station:S2"), 1u);
  Screenshot(window_.get(), "review");
  QTest::keyClick(window_->review(), Qt::Key_Z, Qt::ControlModifier);
  if (!WaitFor([&] { return reviewed.count() == 2; }, 2000)) Click(window_.get(), "review.undo");
  ASSERT_TRUE(WaitFor([&] { return reviewed.count() == 2; }));
  EXPECT_TRUE(window_->workspace()->snapshot()->excluded.empty());
  QFile::remove(Path("review.jsonl"));
}

TEST_F(DesksTest, VariantsAreComparedStationByStation) {
  window_->ShowDesk("compare");
  auto* errors = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4; }));
  const int row = RowWith(errors, "S1");
  ASSERT_GE(row, 0);
  EXPECT_EQ(errors->item(row, 5)->text(), "0.0200");
  EXPECT_EQ(errors->item(row, 6)->text(), "0.0400");
  EXPECT_EQ(errors->item(row, 7)->text(), "0.0200");
  EXPECT_EQ(errors->horizontalHeaderItem(8)->text(), QString::fromUtf8("\xcf\x83 (m)"));
  EXPECT_EQ(errors->item(row, 8)->text(), "0.1068");  // of 0.05, 0.05 and 0.08 m
  // In the smallest window everything from the station to the status is seen; the panoramas' folder is left out.
  window_->resize(1024, 700);
  ASSERT_TRUE(WaitFor([&] { return window_->width() == 1024 && errors->viewport()->width() < 680; }));
  for (const int c : {2, 3, 4, 5, 6, 7, 8, 9}) {
    EXPECT_FALSE(errors->isColumnHidden(c)) << c;
    EXPECT_GE(errors->columnViewportPosition(c), 0) << c;
    EXPECT_LE(errors->columnViewportPosition(c) + errors->columnWidth(c), errors->viewport()->width()) << c;
  }
  window_->workspace()->Select("station:S2");  // its row is looked for, its columns stay
  EXPECT_EQ(errors->horizontalScrollBar()->value(), 0);
  EXPECT_EQ(errors->item(row, 4)->text(), "p001.jpg");
  EXPECT_EQ(errors->item(row, 4)->toolTip(), "panoramas/p001.jpg");
  window_->resize(1280, 800);
  const auto* paired = Child<QTextBrowser>(window_.get(), "compare.text");
  EXPECT_THAT(paired->toPlainText().toStdString(),
              AllOf(HasSubstr("panorama (G2)"), HasSubstr("surveyed control"), Not(HasSubstr("single")),
                    HasSubstr("errors [m]"), Not(HasSubstr("|"))));
  EXPECT_EQ(paired->document()->rootFrame()->childFrames().size(), 1);  // a table, drawn as one
  EXPECT_EQ(errors->item(row, 0)->text(), "surveyed control");
  window_->workspace()->SetUnit("ft");
  EXPECT_TRUE(WaitFor([&] { return paired->toPlainText().contains("errors [ft]"); }));
  window_->workspace()->SetUnit("m");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4 && paired->toPlainText().contains("errors [m]"); }));
  ClickRow(errors, row);
  EXPECT_EQ(window_->workspace()->selected(), "station:S1");
  Screenshot(window_.get(), "compare");
}

TEST_F(DesksTest, OptionFormsSayRangesAndTheCommandLineFollows) {
  window_->ShowDesk("run");
  window_->run_desk()->Choose("detect", "");
  auto* command = Child<QLineEdit>(window_.get(), "run.command");
  EXPECT_EQ(command->text(), "trigpoint detect " + site_->path());
  auto* option = Child<QLineEdit>(window_.get(), "option.min_margin");
  EXPECT_FALSE(option->toolTip().isEmpty());
  EXPECT_EQ(option->accessibleName(), "min_margin");
  Type(window_.get(), "option.min_margin", "40.5");
  EXPECT_EQ(command->text().toStdString(),
            ("trigpoint detect " + site_->path() + " --set min_margin=40.5").toStdString());
  EXPECT_TRUE(Child<QAbstractButton>(window_.get(), "run.run")->isEnabled());
  Screenshot(window_.get(), "run");
  Type(window_.get(), "option.min_margin", "-1");
  EXPECT_FALSE(Child<QAbstractButton>(window_.get(), "run.run")->isEnabled());
  EXPECT_THAT(Child<QLabel>(window_.get(), "run.problem")->text().toStdString(), HasSubstr("min_margin"));
  Type(window_.get(), "option.min_margin", "many");
  EXPECT_THAT(Child<QLabel>(window_.get(), "run.problem")->text().toStdString(), HasSubstr("expected a number"));
  Click(window_.get(), "run.reset");
  EXPECT_EQ(command->text(), "trigpoint detect " + site_->path());
}

TEST_F(DesksTest, EveryWidgetThatTakesInputHasAName) {
  for (const char* desk : kDesks) {
    window_->ShowDesk(desk);
    EXPECT_EQ(window_->desk(), desk);
    for (QWidget* widget : window_->findChildren<QWidget*>()) {
      if (!widget->isVisible() || widget->objectName().startsWith("qt_") || widget->parentWidget() == nullptr) continue;
      const bool input =
          qobject_cast<QComboBox*>(widget) != nullptr || qobject_cast<QAbstractItemView*>(widget) != nullptr ||
          qobject_cast<QSlider*>(widget) != nullptr || qobject_cast<QAbstractSpinBox*>(widget) != nullptr ||
          qobject_cast<PictureView*>(widget) != nullptr ||
          (qobject_cast<QLineEdit*>(widget) != nullptr && !widget->parentWidget()->inherits("QComboBox") &&
           !widget->parentWidget()->inherits("QAbstractSpinBox"));
      if (input && !widget->inherits("QHeaderView")) {
        EXPECT_FALSE(widget->accessibleName().isEmpty())
            << desk << " " << widget->metaObject()->className() << " " << widget->objectName().toStdString();
      }
      const auto* button = qobject_cast<QAbstractButton*>(widget);
      if (button != nullptr && !widget->inherits("QToolButton") && !widget->inherits("QTableCornerButton")) {
        EXPECT_FALSE(button->text().isEmpty() && button->accessibleName().isEmpty())
            << desk << " " << button->objectName().toStdString();
      }
    }
  }
  for (int key = 1; key <= 10; ++key) {  // Ctrl+1 ... Ctrl+9, Ctrl+0
    QTest::keyClick(window_.get(), static_cast<Qt::Key>(Qt::Key_0 + key % 10), Qt::ControlModifier);
  }
  EXPECT_EQ(window_->desk(), "calibration");
}

TEST_F(DesksTest, DarkAndLight) {
  window_->ShowDesk("tables");
  window_->SetTheme("dark");
  EXPECT_LT(QApplication::palette().color(QPalette::Window).lightness(), 90);
  Screenshot(window_.get(), "dark");
  window_->SetTheme("light");
  EXPECT_GT(QApplication::palette().color(QPalette::Window).lightness(), 160);
  window_->SetTheme("system");
}

// Marks whatever goes through tr().
class Marking : public QTranslator {
 public:
  QString translate(const char*, const char* text, const char*, int) const override {
    return QString::fromUtf8("\xc2\xbb") + QString::fromUtf8(text);
  }
  bool isEmpty() const override { return false; }
};

TEST_F(DesksTest, WhatIsReadOnButtonsMenusAndTabsCanBeTranslated) {
  Marking marking;
  QApplication::installTranslator(&marking);
  {
    const std::unique_ptr<MainWindow> window = OpenWindow(site_->path());
    ASSERT_TRUE(WaitFor([&] { return !window->workspace()->opening(); }));
    const auto check = [](const QString& text, const QObject* of) {
      if (text.isEmpty() || text.startsWith("/")) return;  // a recent project's folder
      EXPECT_TRUE(text.startsWith(QChar(0xbb))) << text.toStdString() << ", " << of->metaObject()->className();
    };
    for (const auto* button : window->findChildren<QAbstractButton*>()) {
      check(button->text(), button);
      check(button->toolTip(), button);
    }
    for (const auto* action : window->findChildren<QAction*>()) check(action->text(), action);
    for (const auto* bar : window->findChildren<QTabBar*>()) {
      for (int i = 0; i < bar->count(); ++i) check(bar->tabText(i), bar);
    }
    for (const auto* widget : window->findChildren<QWidget*>()) check(widget->accessibleName(), widget);
    for (const char* column : {"error_3d_m", "qx", "stated_east_m"}) {
      EXPECT_THAT(ColumnHelp({}, column, "").toStdString(),
                  AllOf(StartsWith("\xc2\xbb"), HasSubstr("\n\xc2\xbbIn the file: ")));
    }
    EXPECT_THAT(ColumnHelp({}, "stated_east_m", "").toStdString(), HasSubstr("\xc2\xbbstated"));
  }
  QApplication::removeTranslator(&marking);
}

TEST_F(DesksTest, SessionComesBackAfterACrash) {
  window_->ShowDesk("tables");
  window_->workspace()->Select("station:S3");
  window_->workspace()->SetUnit("us-ft");
  QTest::qWait(600);  // written without any quitting
  MainWindow again;
  again.show();
  again.RestoreSession();
  EXPECT_TRUE(WaitFor([&] { return again.workspace()->snapshot() != nullptr; }));
  EXPECT_EQ(again.desk(), "tables");
  EXPECT_EQ(again.workspace()->selected(), "station:S3");
  EXPECT_EQ(again.workspace()->unit(), "us-ft");
}

TEST(BrokenProjects, OpenAsFarAsTheyCan) {
  QSettings().clear();
  const QTemporaryDir site;
  ResultsSiteSize size;
  size.images = 4, size.points = 50;
  WriteResultsSite(site.path().toStdString(), size);
  WriteFileAtomically((site.path() + "/trigpoint.yaml").toStdString(), "nme: x\n");
  WriteFileAtomically((site.path() + "/results/evaluate/errors.csv").toStdString(), "run,varian\n1\n");
  WriteFileAtomically((site.path() + "/results/localize/run1/sparse/points3D.bin").toStdString(), "no model");
  const auto window = OpenWindow(site.path());
  EXPECT_TRUE(WaitFor([&] { return window->problem()->isVisible(); }));
  EXPECT_THAT(window->problem()->sentence().toStdString(), HasSubstr("trigpoint.yaml:1"));
  EXPECT_FALSE(window->tree()->findItems("S2", Qt::MatchExactly | Qt::MatchRecursive).isEmpty());
  for (const char* desk :
       {"scene", "images", "tables", "compare", "review", "panoramas", "calibration", "print", "check"}) {
    window->ShowDesk(desk);
    QTest::qWait(100);
  }
  window->ShowDesk("scene");
  EXPECT_TRUE(WaitFor([&] { return window->scene()->HasScene(); }));
  Click(window.get(), "problem.details");
  Click(window.get(), "problem.copy");
  EXPECT_THAT(QApplication::clipboard()->text().toStdString(), HasSubstr("trigpoint.yaml:1"));
  Screenshot(window.get(), "problem");
}

TEST(BrokenProjects, NoFolderIsOneSentence) {
  QSettings().clear();
  const auto window = OpenWindow("");
  window->OpenProject("/nowhere/at/all");
  EXPECT_TRUE(WaitFor([&] { return window->problem()->isVisible(); }));
  EXPECT_THAT(window->problem()->sentence().toStdString(), HasSubstr("/nowhere/at/all"));
}

TEST(NewProjects, AFolderDraggedInIsLookedAtAndBecomesOneOnRequest) {
  QSettings().clear();
  const QTemporaryDir site;
  ResultsSiteSize size;
  size.images = 4, size.points = 50;
  WriteResultsSite(site.path().toStdString(), size);
  const auto window = OpenWindow("");
  QMimeData data;
  data.setUrls({QUrl::fromLocalFile(site.path())});
  // As Qt does it: what enters chooses the widget on which it is dropped.
  QDragEnterEvent enter({100, 100}, Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(window.get(), &enter);
  EXPECT_TRUE(enter.isAccepted());
  QDropEvent drop({100, 100}, Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
  QApplication::sendEvent(window.get(), &drop);
  EXPECT_EQ(window->desk(), "overview");
  auto* next = Child<QAbstractButton>(window.get(), "overview.next");
  ASSERT_TRUE(WaitFor([&] { return next->isVisible(); }));
  EXPECT_THAT(next->text().toStdString(), HasSubstr("trigpoint.yaml"));
  QString shown;
  for (const auto* label : window->overview()->findChildren<QLabel*>()) shown += label->text();
  EXPECT_THAT(shown.toStdString(), HasSubstr("run run1: 4 images"));
  EXPECT_FALSE(QFile::exists(site.path() + "/trigpoint.yaml"));
  Screenshot(window.get(), "folder");
  QTest::mouseClick(next, Qt::LeftButton);
  EXPECT_TRUE(WaitFor([&] { return QFile::exists(site.path() + "/trigpoint.yaml"); }));
}

}  // namespace
}  // namespace trigpoint
