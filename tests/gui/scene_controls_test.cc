// Mouse and keyboard in the scene: zooming, keys, standing inside, coordinates, measuring.
#include <gmock/gmock.h>
#include <vtkCamera.h>
#include <vtkNew.h>

#include <QCheckBox>
#include <QClipboard>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QListWidget>
#include <QSignalSpy>
#include <QSlider>
#include <QSpinBox>
#include <QWheelEvent>
#include <cmath>
#include <set>

#include "app/desktop/measurement.h"
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

  SceneDesk* scene_ = nullptr;
  QWidget* view_widget_ = nullptr;
};

TEST_F(SceneControlsTest, WheelZoomsToTheMouseInEveryMode) {
  for (const char* mode : {"plan", "orbit", "fly"}) {
    scene_->SetMode(mode);
    const QPointF before = At("panorama:panoramas/p001.jpg"), other = At("panorama:panoramas/p002.jpg");
    Wheel(before, 3);
    const QPointF after = At("panorama:panoramas/p001.jpg"), further = At("panorama:panoramas/p002.jpg");
    // The ground below it is what stays; seen from the side the panorama above it moves a little.
    EXPECT_LT((after - before).manhattanLength(), mode == std::string("plan") ? 3 : 60) << mode;
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
  const QPointF at = At("panorama:panoramas/p001.jpg");
  EXPECT_LT((at - QPointF(view_widget_->rect().center())).manhattanLength(), 20);
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
  EXPECT_THAT(Child<QLabel>(window_.get(), "scene.text")->text().toStdString(), HasSubstr("p002.jpg"));
  QTest::keyClick(view_widget_, Qt::Key_Escape);
  EXPECT_FALSE(scene_->inside());
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
  EXPECT_EQ(list->item(0, 2)->text().toStdString(), "3.600 \xc2\xb1 0.071");  // 0.05 m twice, along the line
  EXPECT_EQ(list->item(0, 5)->text().left(6).toStdString(), "90.000");
  Screenshot(window_.get(), "scene_measured");
  const QTemporaryDir out;
  list->Save(out.filePath("m.csv"), "site ENU");
  const std::string text = ReadTextFile(out.filePath("m.csv").toStdString());
  EXPECT_THAT(text, HasSubstr("frame=site ENU"));
  EXPECT_THAT(text, HasSubstr("3.6000,0.07071,3.6000,0.07071,0.0000,0.11314,90.0000"));
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
  window_->workspace()->SetUnit("ft");  // a thousandth of a foot is less
  EXPECT_LE(scene_->PointsShown(), sure);
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

}  // namespace
}  // namespace trigpoint
