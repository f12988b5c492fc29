// Mouse and keyboard in the scene: zooming, keys, standing inside, coordinates, measuring.
#include <QVTKOpenGLNativeWidget.h>
#include <gmock/gmock.h>
#include <vtkCamera.h>
#include <vtkNew.h>

#include <QCheckBox>
#include <QClipboard>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QListWidget>
#include <QMenu>
#include <QMouseEvent>
#include <QPushButton>
#include <QSignalSpy>
#include <QSlider>
#include <QSpinBox>
#include <QStatusBar>
#include <QThreadPool>
#include <QWheelEvent>
#include <cmath>
#include <set>

#include "app/desktop/measurement.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/scene_overlay.h"
#include "app/desktop/scene_styles.h"
#include "datasets/io/text.h"
#include "eval/scene/scene_view.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class SceneControlsTest : public ResultsWindowTest {
 protected:
  void SetUp() override {
    ResultsWindowTest::SetUp();
    ShowScene();
    scene_ = window_->scene();
    view_widget_ = Child<QWidget>(window_.get(), "scene.view");
    auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
    ASSERT_TRUE(WaitFor([&] { return !layers->findItems("points", Qt::MatchExactly).isEmpty(); }));
  }
  QPointF At(const char* object) { return scene_->PlaceOf(object) / view_widget_->devicePixelRatioF(); }
  void Wheel(const QPointF& at, int notches) {
    QWheelEvent event(at, view_widget_->mapToGlobal(at.toPoint()), {}, {0, 120 * notches}, Qt::NoButton, {},
                      Qt::NoScrollPhase, false);
    QApplication::sendEvent(view_widget_, &event);
  }
  void Mouse(QEvent::Type type, const QPointF& at, Qt::MouseButton button, Qt::MouseButtons held) {
    QMouseEvent event(type, at, view_widget_->mapToGlobal(at.toPoint()), button, held, {});
    QApplication::sendEvent(view_widget_, &event);
  }
  void ShowOnly(const QStringList& shown) {
    auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
    for (int i = 0; i < layers->count(); ++i) {
      layers->item(i)->setCheckState(shown.contains(layers->item(i)->text()) ? Qt::Checked : Qt::Unchecked);
    }
  }
  std::string Text(const char* label) { return Child<QLabel>(window_.get(), label)->text().toStdString(); }
  // What runs in the background is done, and said.
  static void Settle() {
    QThreadPool::globalInstance()->waitForDone();
    QApplication::processEvents();
  }

  SceneDesk* scene_ = nullptr;
  QWidget* view_widget_ = nullptr;
};

TEST_F(SceneControlsTest, WheelZoomsToTheMouseInEveryMode) {
  for (const char* mode : {"plan", "orbit", "fly"}) {
    scene_->SetMode(mode);
    const QPointF before = At("panorama:panoramas/p001.jpg"), other = At("panorama:panoramas/p002.jpg");
    Wheel(before, 3);
    const QPointF after = At("panorama:panoramas/p001.jpg"), further = At("panorama:panoramas/p002.jpg");
    EXPECT_LT((after - before).manhattanLength(), 3) << mode;
    EXPECT_GT((further - after).manhattanLength(), 1.2 * (other - before).manhattanLength()) << mode;
  }
}

TEST_F(SceneControlsTest, HomeShowsAllAndFTheSelection) {
  scene_->SetMode("orbit");
  const QImage all = scene_->Screenshot(320, 200);
  window_->workspace()->Select("panorama:panoramas/p001.jpg");
  const QImage selected = scene_->Screenshot(320, 200);
  view_widget_->setFocus();
  QTest::keyClick(view_widget_, Qt::Key_F);
  // With what belongs to it: its surveyed point.
  const QPointF at = 0.5 * (At("panorama:panoramas/p001.jpg") + At("control:1"));
  EXPECT_LT((at - QPointF(view_widget_->rect().center())).manhattanLength(), 5);
  Screenshot(window_.get(), "scene_selected");
  QTest::keyClick(view_widget_, Qt::Key_Home);
  EXPECT_EQ(scene_->Screenshot(320, 200), selected);
  window_->workspace()->Select("");
  EXPECT_EQ(scene_->Screenshot(320, 200), all);
}

TEST_F(SceneControlsTest, NoKeyOfVtkChangesTheView) {
  const QImage before = scene_->Screenshot(320, 200);
  view_widget_->setFocus();
  for (const Qt::Key key : {Qt::Key_3, Qt::Key_R, Qt::Key_W, Qt::Key_S, Qt::Key_P, Qt::Key_J, Qt::Key_T, Qt::Key_A}) {
    QTest::keyClick(view_widget_, key);
    EXPECT_EQ(scene_->Screenshot(320, 200), before) << key;
  }
}

TEST_F(SceneControlsTest, LeavingAPanoramaLeavesNothingBehind) {
  Wheel(QPointF(view_widget_->rect().center()), 2);
  const QImage before = scene_->Screenshot(320, 200);
  QSignalSpy stepped(scene_, &SceneDesk::SteppedInside);
  ASSERT_TRUE(scene_->StepInside("panoramas/p001.jpg"));
  ASSERT_TRUE(WaitFor([&] { return stepped.count() == 1; }));
  Screenshot(window_.get(), "scene_inside");
  const QImage inside = scene_->Screenshot(320, 200);
  QTest::mousePress(view_widget_, Qt::LeftButton, {}, {200, 200});
  QTest::mouseMove(view_widget_, {260, 220});
  QTest::qWait(60);
  QTest::mouseMove(view_widget_, {300, 240});
  QTest::qWait(60);
  QTest::mouseRelease(view_widget_, Qt::LeftButton, {}, {300, 240});
  EXPECT_NE(scene_->Screenshot(320, 200), inside);
  view_widget_->setFocus();
  QTest::keyClick(view_widget_, Qt::Key_PageDown);
  ASSERT_TRUE(WaitFor([&] { return stepped.count() == 2; }));
  EXPECT_THAT(Text("scene.text"), HasSubstr("p002.jpg"));
  EXPECT_THAT(Text("scene.note"), HasSubstr("inside panoramas/p002.jpg"));
  EXPECT_EQ(window_->workspace()->selected(), "panorama:panoramas/p002.jpg");
  QTest::keyClick(view_widget_, Qt::Key_Escape);
  EXPECT_FALSE(scene_->inside());
  window_->workspace()->Select("");
  EXPECT_EQ(scene_->Screenshot(320, 200), before);
}

TEST_F(SceneControlsTest, CoordinatesUnderTheMouseAreShownAndCopied) {
  scene_->SetMode("plan");
  QTest::mouseMove(view_widget_, At("panorama:panoramas/p001.jpg").toPoint());
  auto* place = Child<QLabel>(window_.get(), "scene.place");
  ASSERT_TRUE(WaitFor([&] { return place->text().contains("WGS 84"); }));
  const QStringList words = place->text().split(' ', Qt::SkipEmptyParts);
  EXPECT_NEAR(words[1].toDouble(), 2.7, 0.1) << place->text().toStdString();
  EXPECT_NEAR(words[3].toDouble(), -4, 0.1) << place->text().toStdString();
  EXPECT_THAT(place->text().toStdString(), HasSubstr("47.99996"));
  EXPECT_TRUE(window_->statusBar()->isAncestorOf(place));
  EXPECT_TRUE(place->isVisible());
  view_widget_->setFocus();
  QTest::keyClick(view_widget_, Qt::Key_C, Qt::ControlModifier);
  EXPECT_EQ(QApplication::clipboard()->text(), place->text());
}

TEST_F(SceneControlsTest, MeasurementsAreListedWithTheirSigmasAndSaved) {
  scene_->SetMode("plan");
  auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
  for (const char* layer : {"points", "labels", "errors", "ellipsoids", "geotags"}) {
    for (QListWidgetItem* item : layers->findItems(layer, Qt::MatchExactly)) item->setCheckState(Qt::Unchecked);
  }
  Child<QCheckBox>(window_.get(), "scene.measure")->setChecked(true);
  const QPointF a = scene_->PlaceOf("panorama:panoramas/p000.jpg"), b = scene_->PlaceOf("panorama:panoramas/p002.jpg");
  scene_->PickAt(a.x(), a.y());
  scene_->PickAt(b.x(), b.y());
  MeasurementList* list = scene_->measurements();
  ASSERT_EQ(list->rowCount(), 1);
  EXPECT_TRUE(list->isVisible());
  EXPECT_TRUE(Child<QPushButton>(window_.get(), "scene.save_measurements")->isVisible());
  // At once; its sigmas follow.
  EXPECT_EQ(list->item(0, 2)->text(), "3.600");
  EXPECT_EQ(list->item(0, 6)->text(), "being computed ...");
  const QTemporaryDir early;
  list->Save(early.filePath("m.csv"), "site ENU");
  EXPECT_THAT(ReadTextFile(early.filePath("m.csv").toStdString()), HasSubstr(",pending"));
  ASSERT_TRUE(WaitFor([&] { return list->item(0, 6)->text() == "independent"; }));
  EXPECT_EQ(list->item(0, 2)->text().toStdString(), "3.600 \xc2\xb1 0.071");  // 0.05 m twice, along the line
  EXPECT_EQ(list->item(0, 5)->text().left(6).toStdString(), "90.000");
  Screenshot(window_.get(), "scene_measured");
  const QTemporaryDir out;
  list->Save(out.filePath("m.csv"), "site ENU");
  const std::string text = ReadTextFile(out.filePath("m.csv").toStdString());
  EXPECT_THAT(text, HasSubstr("frame=site ENU"));
  EXPECT_THAT(text, HasSubstr("3.6000,0.07071,3.6000,0.07071,0.0000,0.11314,90.0000"));
  // The line's label, too.
  const QImage metres = scene_->Screenshot(320, 200);
  EXPECT_THAT(Text("scene.note"), HasSubstr("3.600 m"));
  window_->workspace()->SetUnit("ft");
  EXPECT_THAT(Text("scene.note"), HasSubstr("11.811 ft"));
  EXPECT_NE(scene_->Screenshot(320, 200), metres);
  window_->workspace()->SetUnit("m");
  // What comes for a list that was cleared meanwhile is not taken for another's.
  const QPointF c = scene_->PlaceOf("panorama:panoramas/p000.jpg"), d = scene_->PlaceOf("panorama:panoramas/p001.jpg");
  scene_->PickAt(c.x(), c.y());
  scene_->PickAt(d.x(), d.y());
  ASSERT_EQ(list->rowCount(), 2);
  list->Clear();
  Settle();
  EXPECT_EQ(list->rowCount(), 0);
}

TEST_F(SceneControlsTest, ARightOrDoubleClickConcernsWhatWasHit) {
  scene_->SetMode("plan");
  QSignalSpy asked(window_->workspace(), &Workspace::MenuAsked), activated(scene_, &SceneDesk::Activated);
  window_->workspace()->Select("station:S2");
  ShowOnly({"optimised"});
  const QPoint on = At("image:run1/images/000008.jpg").toPoint();
  for (const QPoint& at : {on, QPoint(3, 3)}) {
    QTest::mouseClick(view_widget_, Qt::RightButton, {}, at);
    QTest::mouseDClick(view_widget_, Qt::LeftButton, {}, at);
  }
  EXPECT_EQ(asked.count(), 0);
  EXPECT_EQ(activated.count(), 0);
  EXPECT_EQ(window_->workspace()->selected(), "station:S2");
  ShowOnly({"cameras"});
  QTest::mouseClick(view_widget_, Qt::RightButton, {}, on);
  ASSERT_EQ(asked.count(), 1);
  EXPECT_EQ(asked[0][0].toString(), "image:run1/images/000008.jpg");
  for (auto* menu : window_->findChildren<QMenu*>("object.menu")) menu->close();
  QTest::mouseDClick(view_widget_, Qt::LeftButton, {}, on);
  ASSERT_EQ(activated.count(), 1);
  EXPECT_EQ(activated[0][0].toString(), "image:run1/images/000008.jpg");
}

TEST_F(SceneControlsTest, AnErrorIsMeasuredWhereItIsNotWhereItIsDrawn) {
  scene_->SetMode("plan");
  ShowOnly({"errors"});
  scene_->ZoomAt(scene_->PlaceOf("panorama:panoramas/p003.jpg"), 8);
  const QPointF estimate = scene_->PlaceOf("panorama:panoramas/p003.jpg");
  const auto end = [&](int step) {  // of the vector
    QPointF at = estimate;
    for (int i = 0; i < 100; ++i) {
      at.rx() += step;
      if (std::abs(at.x() - estimate.x()) > 12 && scene_->PickAt(at.x(), at.y()).contains("error 0.040")) break;
    }
    return at;
  };
  const QPointF tip = end(4), tail = end(-4);
  Child<QCheckBox>(window_.get(), "scene.measure")->setChecked(true);
  scene_->PickAt(tip.x(), tip.y());
  scene_->PickAt(tail.x(), tail.y());
  ASSERT_EQ(scene_->measurements()->rowCount(), 1);
  const Measurement& m = scene_->measurements()->measurements().front();
  EXPECT_NEAR(m.slope_m, 0.04, 1e-6);
  EXPECT_NEAR(m.from.position.x(), 6.32, 1e-6);
  EXPECT_NEAR(m.to.position.x(), 6.28, 1e-6);
  EXPECT_EQ(m.from.name, "panoramas/p003.jpg");
  EXPECT_EQ(m.to.name, "reference of panoramas/p003.jpg (control)");
  EXPECT_TRUE(m.from.sigma_m);
  EXPECT_FALSE(m.to.sigma_m);
}

TEST_F(SceneControlsTest, FollowingTheRunKeepsThePlanAPlanAndAPanoramaItsCentre) {
  auto* time = Child<QSlider>(window_.get(), "scene.time");
  scene_->SetMode("plan");
  PlanOverlay* overlay = scene_->plan_overlay();
  ASSERT_TRUE(WaitFor([&] { return overlay->isVisible() && overlay->frame().bar_px > 0; }));
  const PlanFrame before = overlay->frame();
  time->setValue(4);
  Child<QCheckBox>(window_.get(), "scene.follow")->setChecked(true);
  EXPECT_LT((At("image:run1/images/000004.jpg") - QPointF(view_widget_->rect().center())).manhattanLength(), 3);
  EXPECT_NEAR(overlay->frame().bar_px, before.bar_px, 1e-6 * before.bar_px);
  EXPECT_NE(overlay->frame(), before);
  QSignalSpy stepped(scene_, &SceneDesk::SteppedInside);
  ASSERT_TRUE(scene_->StepInside("panoramas/p001.jpg"));
  ASSERT_TRUE(WaitFor([&] { return stepped.count() == 1; }));
  const QPointF there = At("control:2");
  time->setValue(9);
  EXPECT_EQ(At("control:2"), there);
}

TEST_F(SceneControlsTest, WhatIsNotInTheSceneIsSaidAndNotesLeaveTheSelectionsNumbers) {
  auto* picture = scene_->findChild<PictureView*>();
  window_->workspace()->Select("panorama:panoramas/p001.jpg");
  EXPECT_THAT(Text("scene.text"), HasSubstr("1 sigma"));
  ASSERT_TRUE(WaitFor([&] { return !picture->image().isNull(); }));
  auto* colour = Child<QComboBox>(window_.get(), "scene.colour");
  colour->setCurrentIndex(colour->findData(static_cast<int>(PointColour::kPicture)));
  EXPECT_THAT(Text("scene.note"), HasSubstr("pictures"));
  EXPECT_TRUE(WaitFor([&] { return Text("scene.note").find("pictures") == std::string::npos; }));
  EXPECT_THAT(Text("scene.text"), HasSubstr("1 sigma"));
  window_->workspace()->Select("tag:77");
  EXPECT_EQ(Text("scene.text"), "tag:77 is not in the scene.");
  EXPECT_TRUE(picture->image().isNull());
  window_->workspace()->Select("");
  EXPECT_EQ(Text("scene.text"), "");
}

TEST_F(SceneControlsTest, OfFastStepsTheLastCountsAndEscapeTakesItBack) {
  QSignalSpy stepped(scene_, &SceneDesk::SteppedInside);
  ASSERT_TRUE(scene_->StepInside("panoramas/p001.jpg"));
  view_widget_->setFocus();
  QTest::keyClick(view_widget_, Qt::Key_Escape);
  Settle();
  EXPECT_FALSE(scene_->inside());
  EXPECT_EQ(stepped.count(), 0);
  ASSERT_TRUE(scene_->StepInside("panoramas/p001.jpg"));
  ASSERT_TRUE(scene_->StepInside("panoramas/p000.jpg"));
  Settle();
  EXPECT_EQ(stepped.count(), 1);
  EXPECT_THAT(Text("scene.note"), HasSubstr("inside panoramas/p000.jpg"));
  for (int i = 0; i < 2; ++i) QTest::keyClick(view_widget_, Qt::Key_PageDown);
  ASSERT_TRUE(WaitFor([&] { return window_->workspace()->selected() == "panorama:panoramas/p002.jpg"; }));
  Settle();
  EXPECT_EQ(stepped.count(), 2);
}

TEST_F(SceneControlsTest, InsideAPanoramaOnlyItsOwnRingIsLeftOut) {
  QSignalSpy stepped(scene_, &SceneDesk::SteppedInside);
  ASSERT_TRUE(scene_->StepInside("panoramas/p000.jpg"));
  ASSERT_TRUE(WaitFor([&] { return stepped.count() == 1; }));
  window_->workspace()->Select("");
  const QImage plain = scene_->Screenshot(320, 200);
  window_->workspace()->Select("panorama:panoramas/p002.jpg");  // straight ahead
  EXPECT_NE(scene_->Screenshot(320, 200), plain);
}

TEST_F(SceneControlsTest, FFitsAllThatBelongsToTheSelection) {
  scene_->SetMode("plan");
  view_widget_->setFocus();
  window_->workspace()->Select("detection:run1/images/000006.jpg#1");
  QTest::keyClick(view_widget_, Qt::Key_F);
  const QPointF middle = 0.5 * (At("image:run1/images/000006.jpg") + At("panorama:panoramas/p001.jpg"));
  EXPECT_LT((middle - QPointF(view_widget_->rect().center())).manhattanLength(), 5);
  // Of a station that is not localized, its surveyed point.
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  const QString file = other.path() + "/results/localize/run1/panoramas.csv";
  const QString rows = QString::fromStdString(ReadTextFile(file.toStdString()));
  WriteFileAtomically(file.toStdString(), QString(rows).replace("S2,localized", "S2,failed").toStdString());
  QSignalSpy loaded(scene_, &SceneDesk::Loaded);
  window_->OpenProject(other.path());
  ASSERT_TRUE(WaitFor([&] { return loaded.count() == 2; }));
  window_->workspace()->Select("station:S2");
  EXPECT_THAT(Text("scene.text"), HasSubstr("station:S2 is not in the scene; what belongs to it is:"));
  EXPECT_THAT(Text("scene.text"), HasSubstr("control point 2"));
  QTest::keyClick(view_widget_, Qt::Key_F);
  EXPECT_LT((At("control:2") - QPointF(view_widget_->rect().center())).manhattanLength(), 3);
}

TEST_F(SceneControlsTest, ADragTurnsAboutWhatIsUnderTheMouse) {
  scene_->SetMode("orbit");
  const QPointF before = At("panorama:panoramas/p001.jpg"), other = At("panorama:panoramas/p002.jpg");
  Mouse(QEvent::MouseButtonPress, before, Qt::LeftButton, Qt::LeftButton);
  for (const int by : {30, 60}) Mouse(QEvent::MouseMove, before + QPointF(by, by / 3), Qt::NoButton, Qt::LeftButton);
  Mouse(QEvent::MouseButtonRelease, before + QPointF(60, 20), Qt::LeftButton, Qt::NoButton);
  EXPECT_GT((At("panorama:panoramas/p002.jpg") - other).manhattanLength(), 10);
  EXPECT_LT((At("panorama:panoramas/p001.jpg") - before).manhattanLength(), 3);
}

TEST_F(SceneControlsTest, LayersKeepTheirOpacityOverAReload) {
  auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
  auto* opacity = Child<QSlider>(window_.get(), "scene.opacity");
  EXPECT_FALSE(opacity->isEnabled());
  const QImage before = scene_->Screenshot(320, 200);
  layers->setCurrentItem(layers->findItems("points", Qt::MatchExactly).front());
  ASSERT_TRUE(opacity->isEnabled());
  opacity->setValue(20);
  const QImage faint = scene_->Screenshot(320, 200);
  EXPECT_NE(faint, before);
  EXPECT_FALSE(layers->findItems("optimised", Qt::MatchExactly).front()->icon().isNull());
  QSignalSpy loaded(scene_, &SceneDesk::Loaded);
  window_->workspace()->Reload();
  ASSERT_TRUE(WaitFor([&] { return loaded.count() >= 1; }));
  EXPECT_TRUE(WaitFor([&] { return scene_->Screenshot(320, 200) == faint; }));
}

// Truth is drawn black: on the dark theme's list its swatch is seen by its outline.
TEST_F(SceneControlsTest, SwatchesAreSeenOnEveryBackground) {
  auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
  const auto outline = [&] {
    const QImage swatch = layers->findItems("optimised", Qt::MatchExactly).front()->icon().pixmap(12, 12).toImage();
    EXPECT_EQ(swatch.pixelColor(6, 6), QColor(0, 114, 178));
    return swatch.pixelColor(0, 6);
  };
  EXPECT_EQ(outline(), layers->palette().color(QPalette::Text));
  window_->SetTheme("dark");
  EXPECT_TRUE(WaitFor([&] { return outline() == layers->palette().color(QPalette::Text); }));
  EXPECT_GT(outline().lightness(), 200);
  window_->SetTheme("system");
}

TEST(Measurement, KnowsSlopeHorizontalHeightAzimuthAndTheirSigmas) {
  const MeasuredPlace a{"a", {1, 1, 1}, Eigen::Vector3d(0.03, 0.03, 0.03), std::nullopt};
  const MeasuredPlace b{"b", {4, 5, 13}, Eigen::Vector3d(0.04, 0.04, 0.04), std::nullopt};
  const Measurement m = MeasureBetween(a, b, true);
  EXPECT_NEAR(m.slope_m, 13, 1e-12);
  EXPECT_NEAR(m.horizontal_m, 5, 1e-12);
  EXPECT_NEAR(m.height_m, 12, 1e-12);
  EXPECT_NEAR(*m.azimuth_deg, 36.8699, 1e-4);
  EXPECT_NEAR(*m.sigma_slope_m, 0.05, 1e-12);  // the same in every direction
  EXPECT_NEAR(*m.sigma_horizontal_m, 0.05, 1e-12);
  EXPECT_NEAR(*m.sigma_height_m, 0.05, 1e-12);
  EXPECT_NEAR(*m.sigma_azimuth_deg, 0.05 / 5 * 180 / M_PI, 1e-9);
  const Measurement unknown = MeasureBetween(a, {"c", {4, 5, 13}, std::nullopt, std::nullopt}, false);
  EXPECT_FALSE(unknown.sigma_slope_m);
  EXPECT_FALSE(unknown.azimuth_deg);
}

TEST(Measurement, FollowsTheJointCovarianceWhereItIsKnown) {
  const MeasuredPlace a{"a", {0, 0, 0}, Eigen::Vector3d(1, 1, 1), std::nullopt};
  const MeasuredPlace b{"b", {0, 10, 0}, Eigen::Vector3d(1, 1, 1), std::nullopt};
  const Eigen::Vector3d variances(0.0004, 0.0001, 0.0009);  // both are known well against each other
  const Measurement m = MeasureBetween(a, b, true, Eigen::Matrix3d(variances.asDiagonal()));
  EXPECT_TRUE(m.joint);
  EXPECT_NEAR(*m.sigma_slope_m, 0.01, 1e-12);
  EXPECT_NEAR(*m.sigma_height_m, 0.03, 1e-12);
  EXPECT_NEAR(*m.sigma_azimuth_deg, 0.02 / 10 * 180 / M_PI, 1e-9);
  EXPECT_FALSE(MeasureBetween(a, b, true).joint);
}

TEST(TurnAbout, KeepsTheEyeOrThePivotInItsPlace) {
  vtkNew<vtkCamera> camera;
  camera->SetPosition(1, 2, 3);
  camera->SetFocalPoint(1, 3, 3);
  TurnAbout(camera, {1, 2, 3}, 90, 0);
  EXPECT_NEAR(camera->GetPosition()[0], 1, 1e-12);
  EXPECT_NEAR(camera->GetFocalPoint()[0], 0, 1e-12);  // north turned to the left is west
  EXPECT_NEAR(camera->GetFocalPoint()[1], 2, 1e-12);
  TurnAbout(camera, {1, 2, 3}, 0, 500);
  double direction[3];
  camera->GetDirectionOfProjection(direction);
  EXPECT_NEAR(direction[2], std::sin(89 * M_PI / 180), 1e-9);  // never over the top
}

TEST_F(SceneControlsTest, TheCubeShowsTheDirectionOfViewAndSetsIt) {
  scene_->SetMode("orbit");
  ViewCube* cube = scene_->cube();
  ASSERT_TRUE(WaitFor([&] { return cube->isVisible(); }));
  const Eigen::Vector3d top = Eigen::Vector3d::UnitZ(), north = Eigen::Vector3d::UnitY();
  EXPECT_LT(cube->MiddleOf(north).x(), 0);  // seen from the south-west
  QTest::mouseClick(cube, Qt::LeftButton, {}, cube->MiddleOf(-north).toPoint());
  ASSERT_TRUE(WaitFor([&] { return cube->MiddleOf(top).x() < 0; }));  // level now
  EXPECT_LT((cube->MiddleOf(-north) - QPointF(cube->rect().center())).manhattanLength(), 3);
  view_widget_->setFocus();
  QTest::keyClick(view_widget_, Qt::Key_T, Qt::ShiftModifier);
  ASSERT_TRUE(WaitFor([&] { return cube->MiddleOf(top).x() >= 0; }));
  EXPECT_LT((cube->MiddleOf(top) - QPointF(cube->rect().center())).manhattanLength(), 4);
  Screenshot(window_.get(), "scene_from_above");
  scene_->SetMode("plan");
  EXPECT_FALSE(cube->isVisible());
}

TEST_F(SceneControlsTest, AxesAreThereFromTheBeginning) {
  const QListWidget* layers = Child<QListWidget>(window_.get(), "scene.layers");
  const auto axes = layers->findItems("axes", Qt::MatchExactly);
  ASSERT_EQ(axes.size(), 1);
  EXPECT_EQ(axes[0]->checkState(), Qt::Checked);
}

TEST_F(SceneControlsTest, WhoAsksToSeeSomethingStepsOutside) {
  QSignalSpy stepped(scene_, &SceneDesk::SteppedInside);
  ASSERT_TRUE(scene_->StepInside("panoramas/p001.jpg"));
  ASSERT_TRUE(WaitFor([&] { return stepped.count() == 1; }));
  scene_->LookAt("panorama:panoramas/p002.jpg");
  EXPECT_FALSE(scene_->inside());
  EXPECT_TRUE(view_widget_->rect().contains(At("panorama:panoramas/p002.jpg").toPoint()));
}

TEST_F(SceneControlsTest, AnotherProjectIsDrawnAsItIs) {
  auto* layers = Child<QListWidget>(window_.get(), "scene.layers");
  auto* runs = Child<QListWidget>(window_.get(), "scene.runs");
  ASSERT_GT(runs->count(), 0);
  runs->item(0)->setCheckState(Qt::Unchecked);
  Child<QSpinBox>(window_.get(), "scene.least_images")->setValue(1000);
  layers->setCurrentRow(0);
  Child<QSlider>(window_.get(), "scene.opacity")->setValue(10);
  window_->workspace()->Close();
  EXPECT_EQ(Text("scene.note"), "Open a project (Ctrl+O): its scene is drawn here.");
  window_->OpenProject(site_->path());
  ShowScene();
  ASSERT_TRUE(WaitFor([&] { return runs->count() > 0; }));
  EXPECT_EQ(runs->item(0)->checkState(), Qt::Checked);
  EXPECT_TRUE(WaitFor([&] { return scene_->PointsShown() > 100; }));
  layers->setCurrentRow(0);
  EXPECT_EQ(Child<QSlider>(window_.get(), "scene.opacity")->value(), 100);
}

TEST_F(SceneControlsTest, ThePlanKeepsItsScaleAndGrid) {
  scene_->SetMode("plan");
  PlanOverlay* overlay = scene_->plan_overlay();
  ASSERT_TRUE(WaitFor([&] { return overlay->isVisible() && overlay->frame().bar_px > 0; }));
  const PlanFrame before = overlay->frame();
  scene_->ZoomAt({200, 200}, 2);
  EXPECT_NEAR(overlay->frame().bar_px, 2 * before.bar_px, 0.01 * before.bar_px);
  // A pixel's coordinates are those under the mouse.
  QTest::mouseMove(view_widget_, {120, 90});
  auto* place = Child<QLabel>(window_.get(), "scene.place");
  ASSERT_TRUE(WaitFor([&] { return place->text().contains("WGS 84"); }));
  window_->workspace()->SetUnit("ft");
  EXPECT_NEAR(overlay->frame().bar_px, 2 * before.bar_px * 0.3048, 0.01 * before.bar_px);
  Screenshot(window_.get(), "scene_grid");
}

TEST_F(SceneControlsTest, PointsAreFilteredColouredAndShaded) {
  const size_t all = scene_->PointsShown();
  ASSERT_GT(all, 100U);
  auto* least = Child<QSpinBox>(window_.get(), "scene.least_images");
  least->setValue(1000);
  EXPECT_EQ(scene_->PointsShown(), 0U);
  least->setValue(0);
  EXPECT_EQ(scene_->PointsShown(), all);
  auto* sigma = Child<QDoubleSpinBox>(window_.get(), "scene.most_sigma");
  sigma->setValue(0.001);
  const size_t sure = scene_->PointsShown();
  EXPECT_LT(sure, all);
  sigma->setValue(0.1);
  window_->workspace()->SetUnit("ft");
  EXPECT_NEAR(sigma->value(), 0.328, 0.001);  // the same length
  sigma->setValue(0);
  window_->workspace()->SetUnit("m");
  auto* colour = Child<QComboBox>(window_.get(), "scene.colour");
  std::set<QByteArray> pictures;
  const auto picture = [&] {
    const QImage image = scene_->Screenshot(320, 200);
    pictures.insert(
        QByteArray(reinterpret_cast<const char*>(image.constBits()), static_cast<int>(image.sizeInBytes())));
  };
  picture();
  Child<QCheckBox>(window_.get(), "scene.percentiles")->setChecked(true);
  picture();
  Child<QCheckBox>(window_.get(), "scene.percentiles")->setChecked(false);
  for (const PointColour by : {PointColour::kTrackLength, PointColour::kResidual, PointColour::kPicture}) {
    colour->setCurrentIndex(colour->findData(static_cast<int>(by)));
    picture();
  }
  EXPECT_EQ(pictures.size(), 5U);
  auto* edl = Child<QCheckBox>(window_.get(), "scene.edl");
  edl->setChecked(true);
  EXPECT_TRUE(scene_->shades_by_depth());
  picture();
  EXPECT_EQ(pictures.size(), 6U);
  Screenshot(window_.get(), "scene_shaded");
  edl->setChecked(false);
  EXPECT_FALSE(scene_->shades_by_depth());
}

class ManyPointsTest : public testing::Test {
 protected:
  static constexpr int kPoints = 4 * SceneView::kMovingPoints;
  void SetUp() override {
    QSettings().clear();
    WriteResultsSite(site_.path().toStdString(), {.points = kPoints});
    window_ = OpenWindow(site_.path());
    window_->ShowDesk("scene");
    scene_ = window_->scene();
    view_ = Child<QVTKOpenGLNativeWidget>(window_.get(), "scene.view");
    ASSERT_TRUE(WaitFor([&] { return scene_->PointsShown() > size_t{kPoints} / 2; }));
  }
  QImage Drawn() const { return view_->grabFramebuffer().convertToFormat(QImage::Format_RGB888); }

  QTemporaryDir site_;
  std::unique_ptr<MainWindow> window_;
  SceneDesk* scene_ = nullptr;
  QVTKOpenGLNativeWidget* view_ = nullptr;
};

int Painted(const QImage& image) {
  int painted = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) painted += image.pixel(x, y) != image.pixel(image.width() - 1, 0) ? 1 : 0;
  }
  return painted;
}

TEST_F(ManyPointsTest, ASelectionIsSeenAtOnceWithSomeOfThemAndAllFollow) {
  auto* points = Child<QSlider>(window_.get(), "scene.size");
  points->setValue(1);
  ASSERT_TRUE(scene_->PointsShown() > size_t{SceneView::kMovingPoints});
  ASSERT_TRUE(WaitFor([&] { return scene_->PointsDrawn() == scene_->PointsShown(); }));
  window_->workspace()->Select("station:S2");
  EXPECT_EQ(scene_->PointsDrawn(), size_t{SceneView::kMovingPoints});
  const QImage at_once = Drawn();
  QImage later = at_once;
  ASSERT_TRUE(WaitFor([&] { return (later = Drawn()) != at_once; }, 5000));
  EXPECT_LT(Painted(at_once), 0.95 * Painted(later));
  window_->workspace()->Select("");
  EXPECT_NE(Drawn(), at_once);
  EXPECT_LT(Painted(Drawn()), Painted(later));
  // Several selections one after the other wait for the last.
  for (const char* station : {"station:S0", "station:S1"}) window_->workspace()->Select(station);
  const int some = Painted(Drawn());
  ASSERT_TRUE(WaitFor([&] { return Painted(Drawn()) > some; }, 5000));
}

}  // namespace
}  // namespace trigpoint
