// Work at the desks, by mouse and keyboard: moving about the scene, points and their images, roles, photo sets,
// calibrations.
#include <gmock/gmock.h>

#include <QCheckBox>
#include <QComboBox>
#include <QImage>
#include <QLabel>
#include <QListWidget>
#include <QSignalSpy>
#include <QSlider>
#include <QTabWidget>
#include <QTableWidget>

#include "app/desktop/compare_desk.h"
#include "app/desktop/images_desk.h"
#include "app/desktop/picture_view.h"
#include "app/desktop/review_desk.h"
#include "app/desktop/run_desk.h"
#include "app/desktop/site_tree.h"
#include "datasets/io/text.h"
#include "tests/gui/gui_driver.h"

namespace trigpoint {
namespace {

using testing::HasSubstr;

class WorkTest : public ResultsWindowTest {
 protected:
  // With its points, which follow the rest.
  void ShowPoints() {
    ShowScene();
    layers_ = Child<QListWidget>(window_.get(), "scene.layers");
    ASSERT_TRUE(WaitFor([&] { return !layers_->findItems("points", Qt::MatchExactly).isEmpty(); }));
    scene_ = window_->scene();
    canvas_ = Child<QWidget>(window_.get(), "scene.view");
  }
  void ShowOnly(const QString& layer) {
    for (int i = 0; i < layers_->count(); ++i) {
      layers_->item(i)->setCheckState(layers_->item(i)->text() == layer ? Qt::Checked : Qt::Unchecked);
    }
  }
  QPoint On(const QString& object) { return (scene_->PlaceOf(object) / canvas_->devicePixelRatioF()).toPoint(); }
  std::string Said() { return Child<QLabel>(window_.get(), "scene.text")->text().toStdString(); }

  SceneDesk* scene_ = nullptr;
  QListWidget* layers_ = nullptr;
  QWidget* canvas_ = nullptr;
};

TEST_F(WorkTest, OrbitPlanAndFlyMoveTheView) {
  ShowPoints();
  const auto drag = [&] {
    const QImage before = scene_->Screenshot(320, 200);
    QTest::mousePress(canvas_, Qt::LeftButton, {}, {200, 200});
    QTest::mouseMove(canvas_, {260, 220});
    QTest::qWait(60);
    QTest::mouseMove(canvas_, {300, 240});
    QTest::qWait(60);
    QTest::mouseRelease(canvas_, Qt::LeftButton, {}, {300, 240});
    return scene_->Screenshot(320, 200) != before;
  };
  auto* mode = Child<QComboBox>(window_.get(), "scene.mode");
  for (const char* name : {"orbit", "plan", "fly"}) {
    mode->setFocus();
    QTest::keyClicks(mode, QString(name).left(1));
    scene_->SetMode(name);
    EXPECT_TRUE(drag()) << name;
  }
  scene_->SetMode("orbit");
  canvas_->setFocus();
  for (const Qt::Key key : {Qt::Key_Left, Qt::Key_Up, Qt::Key_Plus, Qt::Key_Minus}) {
    const QImage before = scene_->Screenshot(320, 200);
    QTest::keyClick(canvas_, key);
    EXPECT_NE(scene_->Screenshot(320, 200), before) << key;
  }
}

TEST_F(WorkTest, ColoursFollowWhatIsChosen) {
  ShowPoints();
  auto* colour = Child<QComboBox>(window_.get(), "scene.colour");
  QImage last;
  for (int i = 0; i < colour->count(); ++i) {
    colour->setCurrentIndex(i);
    const QImage now = scene_->Screenshot(320, 200);
    EXPECT_NE(now, last) << i;
    last = now;
  }
}

TEST_F(WorkTest, CameraIsPickedWithItsSigmaAndFollowedAlongTheRun) {
  ShowPoints();
  scene_->SetMode("plan");
  ShowOnly("cameras");
  QTest::mouseClick(canvas_, Qt::LeftButton, {}, On("image:run1/images/000008.jpg"));
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000008.jpg");
  EXPECT_THAT(Said(), HasSubstr("1 sigma 0.020 0.020 0.030 m"));
  window_->workspace()->SetUnit("ft");
  EXPECT_THAT(Said(), HasSubstr("0.066 0.066 0.098 ft"));
  auto* time = Child<QSlider>(window_.get(), "scene.time");
  EXPECT_EQ(time->maximum(), 23);
  time->setFocus();
  QTest::keyClick(time, Qt::Key_Home);
  QTest::keyClick(time, Qt::Key_Right);
  EXPECT_EQ(window_->workspace()->selected(), "image:run1/images/000001.jpg");
  const QImage before = scene_->Screenshot(320, 200);
  Child<QCheckBox>(window_.get(), "scene.follow")->setChecked(true);
  const QImage first = scene_->Screenshot(320, 200);
  EXPECT_NE(first, before);
  QTest::keyClick(time, Qt::Key_PageDown);
  EXPECT_NE(scene_->Screenshot(320, 200), first);
}

TEST_F(WorkTest, PointIsPickedAndSeenInItsImages) {
  ShowPoints();
  scene_->SetMode("plan");
  ShowOnly("points");
  const QString point = "point:run1/7";
  ASSERT_GT(scene_->PlaceOf(point).x(), 0);
  QTest::mouseClick(canvas_, Qt::LeftButton, {}, On(point));
  const QString picked = window_->workspace()->selected();
  ASSERT_TRUE(picked.startsWith("point:run1/")) << picked.toStdString();
  EXPECT_THAT(Said(), HasSubstr("1 sigma"));
  EXPECT_TRUE(WaitFor([&] { return Said().find("seen by images/") != std::string::npos; })) << Said();
  Screenshot(window_.get(), "point");
  // Its first image, and the point in it.
  QTest::mouseDClick(canvas_, Qt::LeftButton, {}, On(point));
  EXPECT_TRUE(WaitFor([&] { return window_->desk() == "images" && window_->images()->left()->scale() > 2; }));
}

TEST_F(WorkTest, ControlPointBecomesACheckPointAndAnImageIsRestored) {
  window_->ShowDesk("review");
  QSignalSpy reviewed(window_->review(), &ReviewDesk::Reviewed);
  int expected = 0;
  const auto decide = [&](const char* object, const char* button) {
    window_->workspace()->Select(object);
    Type(window_.get(), "review.reason", "as the office wrote");
    Click(window_.get(), button);
    ++expected;
    return WaitFor([&] { return reviewed.count() == expected; });
  };
  const auto role_of = [&](const char* object) {
    for (const SnapshotControl& control : window_->workspace()->snapshot()->controls) {
      if (control.object == object) return control.role;
    }
    return std::string();
  };
  EXPECT_EQ(role_of("control:0"), "control");
  ASSERT_TRUE(decide("control:0", "review.role"));
  EXPECT_EQ(role_of("control:0"), "check");
  ASSERT_TRUE(decide("image:run1/images/000003.jpg", "review.exclude"));
  EXPECT_EQ(window_->workspace()->snapshot()->excluded.count("image:run1/images/000003.jpg"), 1u);
  ASSERT_TRUE(decide("image:run1/images/000003.jpg", "review.restore"));
  EXPECT_TRUE(window_->workspace()->snapshot()->excluded.empty());
  EXPECT_EQ(Child<QTableWidget>(window_.get(), "review.entries")->rowCount(), 3);
  QFile::remove(Path("review.jsonl"));
}

TEST_F(WorkTest, RunsStandBesideEachOtherInThreeDimensions) {
  window_->ShowDesk("compare");
  auto* errors = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4; }));
  auto* tabs = window_->compare()->findChild<QTabWidget*>();
  tabs->setCurrentIndex(tabs->count() - 1);
  EXPECT_TRUE(WaitFor([&] {
    const auto scenes = window_->compare()->findChildren<SceneDesk*>();
    return scenes.size() == 2 && scenes[0]->HasScene() && scenes[1]->HasScene();
  }));
  Screenshot(window_.get(), "compare_3d");
  // Errors of nobody's project have no scene.
  const QTemporaryDir alone;
  QFile::copy(Path("results/evaluate/errors.csv"), alone.filePath("errors.csv"));
  ASSERT_TRUE(window_->compare()->Add(alone.path()));
  auto* title = Child<QLabel>(window_.get(), "compare.title_b");
  const auto scenes = window_->compare()->findChildren<SceneDesk*>();
  EXPECT_TRUE(WaitFor([&] {  // a scene that is just read renews the titles, too
    return title->text().contains("errors only") &&
           std::count_if(scenes.begin(), scenes.end(), [](SceneDesk* s) { return s->isVisible(); }) == 1;
  }));
}

TEST_F(WorkTest, AnotherProjectsSceneHasCoordinatesOfItsOwn) {
  const QTemporaryDir other;
  WriteResultsSite(other.path().toStdString(), {});
  WriteFileAtomically((other.path() + "/origin.json").toStdString(), R"({"lat": 48.5, "lon": 7.8, "alt": 240.0})");
  window_->ShowDesk("compare");
  auto* errors = Child<QTableWidget>(window_.get(), "compare.errors");
  ASSERT_TRUE(WaitFor([&] { return errors->rowCount() == 4; }));
  auto* tabs = window_->compare()->findChild<QTabWidget*>();
  tabs->setCurrentIndex(tabs->count() - 1);
  ASSERT_TRUE(window_->compare()->Add(other.path()));
  auto* title = Child<QLabel>(window_.get(), "compare.title_b");
  EXPECT_TRUE(WaitFor([&] { return title->text().contains("origins of the two are"); })) << title->text().toStdString();
  const auto scenes = window_->compare()->findChildren<SceneDesk*>();
  ASSERT_EQ(scenes.size(), 2);
  scenes[0]->SetMode("plan");
  EXPECT_EQ(scenes[1]->mode(), "plan");  // they share a camera
  for (const auto& [scene, latitude] : {std::pair(scenes[0], "WGS 84 47.99"), std::pair(scenes[1], "WGS 84 48.49")}) {
    auto* place = Child<QLabel>(scene, "scene.place");
    QTest::mouseMove(Child<QWidget>(scene, "scene.view"), {60, 60});
    EXPECT_TRUE(WaitFor([&] { return place->text().contains("WGS 84"); }));
    EXPECT_THAT(
        place->text().toStdString(),
        testing::AnyOf(HasSubstr(latitude),
                       HasSubstr(QString(latitude).replace("47.99", "48.00").replace("48.49", "48.50").toStdString())));
  }
}

TEST_F(WorkTest, PhotoSetShowsItsPairsAndCentres) {
  for (const char* name : {"IMG_1.jpg", "IMG_2.jpg", "IMG_3.jpg"}) {
    QDir().mkpath(Path("photos/ring"));
    QImage photo(320, 240, QImage::Format_RGB32);
    photo.fill(QColor(90, 120, 90));
    ASSERT_TRUE(photo.save(Path("photos/ring/") + name));
  }
  const std::string result = Path("results/stitch/ring").toStdString();
  WriteFileAtomically(result + "/rig.csv",
                      "# trigpoint rig 1; frame=rig; sigma=1\n"
                      "photo,tx,ty,tz,qx,qy,qz,qw,sigma_tx_m,sigma_ty_m,sigma_tz_m,focal_px\n"
                      "IMG_1.jpg,0.1,0,0,0,0,0,1,0.01,0.01,0.02,300\n"
                      "IMG_2.jpg,0,0,0.1,0,0.5,0,0.8660254,0.01,0.01,0.02,300\n");
  WriteFileAtomically(result + "/pairs.csv",
                      "# trigpoint pairs 1\nphoto_a,photo_b,matches,candidates\n"
                      "IMG_1.jpg,IMG_2.jpg,120,200\n");
  window_->workspace()->Reload();
  window_->ShowDesk("panoramas");
  auto* set = Child<QComboBox>(window_.get(), "panorama.set");
  ASSERT_TRUE(WaitFor([&] { return set->findText("ring (photo set)") >= 0; }));
  set->setCurrentIndex(set->findText("ring (photo set)"));
  auto* photos = Child<QTableWidget>(window_.get(), "panorama.photos");
  ASSERT_TRUE(WaitFor([&] { return photos->rowCount() == 3; }));
  EXPECT_EQ(photos->item(1, 3)->text(), "0.1000");
  EXPECT_EQ(photos->item(1, 4)->text(), "0.0200");
  EXPECT_EQ(photos->item(2, 5)->text(), "not placed");
  int lines = 0;
  for (const PictureMark& mark : Child<PictureView>(window_.get(), "panorama.graph")->marks()) {
    lines += mark.kind == PictureMark::Kind::kLine ? 1 : 0;
  }
  EXPECT_EQ(lines, 1);
  Screenshot(window_.get(), "panoramas");
  Click(window_.get(), "panorama.stitch");
  EXPECT_EQ(window_->desk(), "run");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(), HasSubstr("trigpoint stitch"));
}

TEST_F(WorkTest, CalibrationSaysWhatToPhotographNext) {
  const std::string result = Path("results/calibrate/wide").toStdString();
  WriteFileAtomically(
      result + "/calibration.json",
      R"({"schema": 1, "cameras": [{"name": "cam0", "model": "radtan", "width": 640, "height": 480, "rms_px": 0.25,
          "views": 12, "views_used": 11, "parameters": {"fx": 500.25, "fy": 501.5}, "sigma": {"fx": 0.5, "fy": 0.6}}],
          "quality": {"findings": [{"level": "warning", "camera": "cam0", "check": "coverage",
          "reason": "the corners are not covered", "advice": "hold the board into the corners"}]}})");
  std::string residuals = "# trigpoint calibration residuals 1\ncamera,image,point,u,v,du_px,dv_px,used\n";
  for (int i = 0; i < 200; ++i) {
    residuals += "cam0,a.png," + std::to_string(i) + "," + std::to_string(40 + i % 20 * 10) + "," +
                 std::to_string(40 + i / 20 * 15) + ",0.1,-0.2,1\n";
  }
  WriteFileAtomically(result + "/residuals.csv", residuals);
  window_->workspace()->Reload();
  window_->ShowDesk("calibration");
  auto* parameters = Child<QTableWidget>(window_.get(), "calibration.parameters");
  ASSERT_TRUE(WaitFor([&] { return parameters->rowCount() == 2; }));
  EXPECT_EQ(parameters->item(0, 1)->text(), "500.25000");
  EXPECT_EQ(parameters->item(0, 2)->text(), "0.5");
  const std::string next = Child<QLabel>(window_.get(), "calibration.next")->text().toStdString();
  EXPECT_THAT(next, HasSubstr("hold the board into the corners"));
  EXPECT_THAT(next, HasSubstr("bottom right"));
  Screenshot(window_.get(), "calibration");
  Click(window_.get(), "calibration.calibrate");
  Type(window_.get(), "option.images", "board/*.jpg");
  EXPECT_THAT(Child<QLineEdit>(window_.get(), "run.command")->text().toStdString(),
              HasSubstr("trigpoint calibrate " + site_->path().toStdString() + " --name cam --set 'images="));
}

}  // namespace
}  // namespace trigpoint
