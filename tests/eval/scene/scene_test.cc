#include <gtest/gtest.h>
#include <vtkBillboardTextActor3D.h>
#include <vtkCamera.h>
#include <vtkPropCollection.h>
#include <vtkRenderer.h>
#include <vtkScalarBarActor.h>

#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/base/error.h"
#include "eval/scene/offscreen.h"
#include "eval/scene/scene_view.h"

namespace trigpoint {
namespace {

// A ring of cameras about four stations with tags below, made without any file.
SceneModel Ring() {
  SceneModel model;
  model.site = "ring", model.frame = "site ENU", model.on_earth = true;
  model.runs = {"run1"};
  ScenePath optimised{ScenePath::Kind::kOptimised, "run1", "localize", {}};
  ScenePath odometry{ScenePath::Kind::kOdometry, "run1", "odometry", {}};
  for (int i = 0; i < 60; ++i) {
    const double a = 2 * 3.14159265358979 * i / 60;
    const Rigid3d pose(Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ()) *
                                          Eigen::AngleAxisd(-1.5707963, Eigen::Vector3d::UnitX())),
                       {12 * std::cos(a), 8 * std::sin(a), 1.5});
    optimised.poses.push_back({i, pose});
    odometry.poses.push_back({i, Rigid3d(pose.rotation, pose.translation * (1 + 0.002 * i))});
    if (i % 5 == 0) {
      model.cameras.push_back({"run1",
                               "im" + std::to_string(i),
                               {},
                               pose,
                               {{-0.8, 0.6, 1}, {0.8, 0.6, 1}, {0.8, -0.6, 1}, {-0.8, -0.6, 1}},
                               {}});
    }
    model.points.push_back({0, i, {15 * std::cos(a), 11 * std::sin(a), 0.1 * i}, 2 + i % 7, 0.01 * (1 + i)});
  }
  model.paths = {optimised, odometry};
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d at(k < 2 ? -5 : 5, k % 2 == 0 ? -3 : 3, 1.8);
    ScenePanorama panorama{"run1", "", "pano" + std::to_string(k), "S" + std::to_string(k)};
    panorama.world_from_pano = Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(-1.5707963, Eigen::Vector3d::UnitX())), at);
    panorama.texture = cv::Mat(64, 128, CV_8UC3, cv::Scalar(200, 120 + 30 * k, 60));
    panorama.geotag = at + Eigen::Vector3d(0.8, -0.5, 0);
    model.panoramas.push_back(panorama);
    SceneTag tag{k, "tag36h11", "free", "survey", 0.5};
    tag.world_from_tag = Rigid3d(panorama.world_from_pano.rotation, at - Eigen::Vector3d(0, 0, 1));
    tag.pattern = (cv::Mat_<uchar>(2, 2) << 0, 255, 255, 0);
    tag.pattern_size_m = 0.6;
    model.tags.push_back(tag);
    SceneError error{"run1", "", "single", panorama.station, panorama.panorama, "control", at, {0.05, 0.02, -0.03}};
    error.sigma_m = Eigen::Vector3d(0.03, 0.03, 0.05);
    model.errors.push_back(error);
  }
  return model;
}

class SceneTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string reason;
    window_ = OffscreenWindow::Create(&reason);
    if (!window_) GTEST_SKIP() << "no OpenGL here: " << reason;
  }
  cv::Mat Draw() {
    cv::Mat small;
    cv::resize(window_->Render(960, 640), small, {}, 0.5, 0.5, cv::INTER_AREA);
    return small;
  }
  Eigen::Vector2d Pixel(const Eigen::Vector3d& p) {
    window_->renderer()->SetWorldPoint(p.x(), p.y(), p.z(), 1);
    window_->renderer()->WorldToDisplay();
    const double* d = window_->renderer()->GetDisplayPoint();
    return {d[0], d[1]};
  }
  std::unique_ptr<OffscreenWindow> window_;
};

constexpr double kThreshold = 1.5;  // grey values; drivers and fonts differ by fractions of one

// Mean over the picture of the channel that differs most.
double Difference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference);
  return std::max({mean[0], mean[1], mean[2]});
}

// TRIGPOINT_WRITE_BASELINES=1 writes them anew: look at them before they are kept.
void ExpectLikeBaseline(const cv::Mat& picture, const std::string& name) {
  const std::string file = "tests/eval/testdata/scene/" + name + ".png";
  if (std::getenv("TRIGPOINT_WRITE_BASELINES") != nullptr) {
    ASSERT_TRUE(cv::imwrite(file, picture));
    return;
  }
  const cv::Mat baseline = cv::imread(file);
  ASSERT_EQ(baseline.size(), picture.size()) << file;
  const double difference = Difference(picture, baseline);
  const std::string seen = ::testing::TempDir() + "trigpoint_scene_" + name + ".png";
  EXPECT_LT(difference, kThreshold) << file << ": what was drawn is in " << seen;
  if (difference >= kThreshold) cv::imwrite(seen, picture);
}

TEST_F(SceneTest, LooksLikeItsBaselines) {
  const SceneModel model = Ring();
  SceneStyle style;
  style.error_scale = 20;
  SceneView view(model, style);
  view.AddTo(window_->renderer());
  window_->Render(960, 640);
  view.LookDown(window_->renderer());
  const cv::Mat plan = Draw();
  ExpectLikeBaseline(plan, "plan");
  view.LookOblique(window_->renderer());
  ExpectLikeBaseline(Draw(), "oblique");
  view.LookAtStation(window_->renderer(), "S2");
  ExpectLikeBaseline(Draw(), "station");
  view.LookDown(window_->renderer());
  EXPECT_EQ(Difference(Draw(), plan), 0) << "the same scene gives the same picture";
  view.SetVisible("ellipsoids", false);
  view.SetVisible("panoramas", false);
  EXPECT_GT(Difference(Draw(), plan), kThreshold) << "the threshold sees layers that are gone";
  view.RemoveFrom(window_->renderer());
}

TEST_F(SceneTest, EllipsoidsAreDrawnAtAScaleThatLeavesTheSiteToBeSeen) {
  SceneModel model = Ring();
  const double scale = SceneView(model).ErrorScale();
  EXPECT_GT(scale, 1);
  for (SceneError& e : model.errors) e.sigma_m = 10 * e.sigma_m.value();
  EXPECT_LE(SceneView(model).ErrorScale(), scale / 5);
  EXPECT_GE(SceneView(model).ErrorScale(), 1);
}

TEST_F(SceneTest, HeightsHaveTheColoursOfAnotherView) {
  SceneModel model = Ring();
  for (int i = 0; i < 100; ++i) model.points.push_back({0, 100 + i, {0, 0, 0.1 * i}, 3, 0.01});
  SceneView view(model);
  view.SetUnit({"ft", 0.3048});
  const auto heights = view.HeightsOfColours();
  ASSERT_TRUE(heights);
  EXPECT_LT((*heights)[0], 1);
  EXPECT_GT((*heights)[1], 9);
  for (ScenePoint& point : model.points) point.position.z() *= 2;
  SceneStyle style;
  style.heights_m = heights;
  SceneView other(model, style);
  EXPECT_NEAR((*other.HeightsOfColours())[1], (*heights)[1], 1e-9);
  EXPECT_GT((*SceneView(model).HeightsOfColours())[1], 1.8 * (*heights)[1]);
  other.ColourPointsBy(PointColour::kTrackLength);
  EXPECT_FALSE(other.HeightsOfColours());
}

TEST_F(SceneTest, DrawsLessWhileItMovesAndEverythingWhenItStands) {
  SceneModel model = Ring();
  for (int i = 0; i < 40000; ++i) {  // a veil along the south, more than are drawn of a scene that moves
    model.points.push_back({0, 100 + i, {-15 + 0.00075 * i, -11 - 0.2 * (i % 7), 1}, 3, 0.01});
  }
  SceneView view(model);
  view.AddTo(window_->renderer());
  window_->Render(960, 640);
  view.LookOblique(window_->renderer());
  const cv::Mat standing = Draw();
  view.DrawMoving(true);
  EXPECT_TRUE(view.Visible("ellipsoids"));  // they only rest
  EXPECT_GT(cv::norm(Draw(), standing, cv::NORM_INF), 0);
  view.SetVisible("ellipsoids", false);
  view.SetVisible("ellipsoids", true);
  view.ColourPointsBy(PointColour::kTrackLength);
  view.DrawMoving(true);
  view.ColourPointsBy(PointColour::kHeight);
  view.DrawMoving(false);
  EXPECT_EQ(cv::norm(Draw(), standing, cv::NORM_INF), 0);
  view.RemoveFrom(window_->renderer());
}

TEST_F(SceneTest, AHiddenRunTakesItsLabelsAndGeotagsAlong) {
  SceneModel model = Ring();
  model.runs = {"run1", "run2"};
  ScenePanorama again = model.panoramas[0];
  again.run = "run2", again.world_from_pano.translation.x() += 3;
  model.panoramas.push_back(again);
  SceneView view(model);
  view.AddTo(window_->renderer());
  view.SetVisible("tags", false);
  window_->Render(960, 640);
  view.LookDown(window_->renderer());
  const auto labels = [&] {
    view.MakeRoomForLabels(window_->renderer());
    std::map<std::string, Eigen::Vector3d> seen;
    vtkPropCollection* props = window_->renderer()->GetViewProps();
    props->InitTraversal();
    while (vtkProp* prop = props->GetNextProp()) {
      auto* label = vtkBillboardTextActor3D::SafeDownCast(prop);
      if (label != nullptr && label->GetVisibility() != 0)
        seen[label->GetInput()] = Eigen::Vector3d(label->GetPosition());
    }
    return seen;
  };
  EXPECT_EQ(labels().count("S1"), 1U);
  const double before = labels().at("S0").x();
  view.SetRunVisible("run1", false);
  EXPECT_EQ(labels().count("S1"), 0U);
  EXPECT_NEAR(labels().at("S0").x(), before + 3, 1e-9);  // where the other run has it
  view.SetRunVisible("run2", false);
  EXPECT_EQ(labels().count("S0"), 0U);
  const cv::Mat hidden = Draw();
  view.SetVisible("geotags", false);
  view.SetVisible("legend", false);
  const cv::Mat without = Draw();
  view.SetVisible("geotags", true);
  EXPECT_EQ(cv::norm(Draw(), without, cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(hidden, without, cv::NORM_INF), 0);  // the legend
  view.RemoveFrom(window_->renderer());
}

TEST_F(SceneTest, ALabelUnderTheLegendIsLeftOut) {
  const SceneModel model = Ring();
  SceneView view(model);
  vtkRenderer* renderer = window_->renderer();
  view.AddTo(renderer);
  view.SetVisible("tags", false);
  window_->Render(960, 640);
  view.LookDown(renderer);
  const auto boxes = view.LegendBoxes(renderer);
  ASSERT_EQ(boxes.size(), 5U);
  for (size_t i = 1; i < boxes.size(); ++i) EXPECT_LT(boxes[i].max().y(), boxes[i - 1].max().y());
  // Where they are said to be there is text, and only there.
  view.SetVisible("legend", false);
  EXPECT_TRUE(view.LegendBoxes(renderer).empty());
  cv::Mat change;
  const cv::Mat without = window_->Render(960, 640);
  view.SetVisible("legend", true);
  cv::absdiff(window_->Render(960, 640), without, change);
  for (const Eigen::AlignedBox2d& box : boxes) {
    const cv::Rect place(static_cast<int>(box.min().x()), static_cast<int>(640 - box.max().y()),
                         static_cast<int>(box.sizes().x()), static_cast<int>(box.sizes().y()));
    EXPECT_GT(cv::norm(change(place), cv::NORM_INF), 100);
    const cv::Rect wider(place.x - 4, place.y - 4, place.width + 8, place.height + 8);
    change(wider & cv::Rect(0, 0, 960, 640)).setTo(0);
  }
  EXPECT_EQ(cv::norm(change, cv::NORM_INF), 0);
  // The view is moved until a station lies there.
  vtkBillboardTextActor3D* label = nullptr;
  vtkPropCollection* props = renderer->GetViewProps();
  props->InitTraversal();
  while (vtkProp* prop = props->GetNextProp()) {
    auto* other = vtkBillboardTextActor3D::SafeDownCast(prop);
    if (other != nullptr && std::string(other->GetInput()) == "S1") label = other;
  }
  ASSERT_NE(label, nullptr);
  vtkCamera* camera = renderer->GetActiveCamera();
  const double metres_per_px = 2 * camera->GetParallelScale() / 640;
  const Eigen::Vector2d by = metres_per_px * (Pixel(Eigen::Vector3d(label->GetPosition())) - boxes[0].center());
  camera->SetPosition(camera->GetPosition()[0] + by.x(), camera->GetPosition()[1] + by.y(), camera->GetPosition()[2]);
  camera->SetFocalPoint(camera->GetFocalPoint()[0] + by.x(), camera->GetFocalPoint()[1] + by.y(),
                        camera->GetFocalPoint()[2]);
  window_->Render(960, 640);
  view.MakeRoomForLabels(renderer);
  EXPECT_EQ(label->GetVisibility(), 0);
  view.SetVisible("legend", false);
  view.MakeRoomForLabels(renderer);
  EXPECT_NE(label->GetVisibility(), 0);
  view.RemoveFrom(renderer);
}

// In a small window the bar of the colours takes the room that its texts need, and no more.
TEST_F(SceneTest, TheBarIsAsWideAsItsTexts) {
  const SceneModel model = Ring();
  SceneStyle style;
  style.text_px = 14;
  SceneView view(model, style);
  vtkRenderer* renderer = window_->renderer();
  view.AddTo(renderer);
  vtkScalarBarActor* bar = nullptr;
  vtkPropCollection* props = renderer->GetViewProps();
  props->InitTraversal();
  while (vtkProp* prop = props->GetNextProp()) {
    if (auto* found = vtkScalarBarActor::SafeDownCast(prop)) bar = found;
  }
  ASSERT_NE(bar, nullptr);
  for (const cv::Size& size : {cv::Size(456, 508), cv::Size(1040, 840)}) {
    window_->Render(size.width, size.height);
    view.MakeRoomForLabels(renderer);
    const cv::Mat with = window_->Render(size.width, size.height);
    bar->SetVisibility(0);
    cv::Mat change;
    cv::absdiff(with, window_->Render(size.width, size.height), change);
    bar->SetVisibility(1);
    cv::cvtColor(change, change, cv::COLOR_BGR2GRAY);
    const cv::Rect taken = cv::boundingRect(change > 0);
    EXPECT_LT(taken.width, 5.2 * style.text_px);
    EXPECT_LT(taken.height, 13 * style.text_px);
    EXPECT_LT(taken.br().x, size.width);
    EXPECT_GT(taken.width, 2.5 * style.text_px);  // colours and numbers; the title is a text of its own
  }
  view.RemoveFrom(renderer);
}

TEST_F(SceneTest, OpacityIsOfLabelsTooAndOutlastsAnotherUnit) {
  const SceneModel model = Ring();
  SceneView view(model);
  view.AddTo(window_->renderer());
  for (const std::string& layer : SceneView::Layers()) view.SetVisible(layer, layer == "labels");
  window_->Render(960, 640);
  view.LookDown(window_->renderer());
  const cv::Mat full = Draw();
  view.SetOpacity("labels", 0.2);
  EXPECT_GT(cv::norm(Draw(), full, cv::NORM_INF), 50);
  view.SetVisible("labels", false);
  view.SetVisible("axes", true);
  view.SetOpacity("axes", 0.2);
  const cv::Mat faint = Draw();
  view.SetUnit({"ft", 0.3048});
  view.SetUnit({"m", 1});
  EXPECT_LT(Difference(Draw(), faint), 1e-3);
  view.RemoveFrom(window_->renderer());
}

TEST_F(SceneTest, AnErrorIsPickedAtBothEndsAndIsWhereItIs) {
  const SceneModel model = Ring();
  SceneStyle style;
  style.error_scale = 50;
  SceneView view(model, style);
  vtkRenderer* renderer = window_->renderer();
  view.AddTo(renderer);
  for (const std::string& layer : SceneView::Layers()) view.SetVisible(layer, layer == "errors");
  window_->Render(960, 640);
  view.LookDown(renderer);
  const SceneError& error = model.errors[1];
  const Eigen::Vector3d drawn = error.reference_position + 50 * error.difference;
  const Eigen::Vector2d tip = Pixel(drawn), tail = Pixel(error.reference_position);
  auto pick = view.Pick(renderer, tip.x(), tip.y());
  ASSERT_TRUE(pick);
  EXPECT_LT((pick->drawn_at - drawn).norm(), 1e-9);
  EXPECT_LT((pick->position - (error.reference_position + error.difference)).norm(), 1e-9);
  pick = view.Pick(renderer, tail.x(), tail.y());
  ASSERT_TRUE(pick);
  EXPECT_EQ(pick->position, error.reference_position);
  view.RemoveFrom(renderer);
}

TEST_F(SceneTest, PicksWhatLiesUnderThePixel) {
  const SceneModel model = Ring();
  SceneView view(model);
  vtkRenderer* renderer = window_->renderer();
  view.AddTo(renderer);
  window_->Render(960, 640);
  view.LookDown(renderer);
  const Eigen::Vector2d tag = Pixel(model.tags[2].world_from_tag.translation);
  auto pick = view.Pick(renderer, tag.x(), tag.y());
  ASSERT_TRUE(pick);
  EXPECT_EQ(pick->layer, "tags");
  EXPECT_EQ(pick->index, 2);
  view.SetVisible("tags", false);
  pick = view.Pick(renderer, tag.x(), tag.y());
  ASSERT_TRUE(pick);
  EXPECT_EQ(pick->layer, "panoramas");
  EXPECT_EQ(pick->name, "pano2");
  const Eigen::Vector2d camera = Pixel(model.cameras[7].world_from_cam.translation);
  pick = view.Pick(renderer, camera.x(), camera.y());
  ASSERT_TRUE(pick);
  EXPECT_EQ(pick->name, "im35");
  EXPECT_EQ(pick->position, model.cameras[7].world_from_cam.translation);
  EXPECT_EQ(view.Describe("cameras", 7).text, pick->text);
  view.SetUnit({"ft", 0.3048});
  EXPECT_NE(view.Describe("cameras", 7).text.find(" ft"), std::string::npos);
  // The scale bar, too, and no metres are left.
  int feet = 0, metres = 0;
  vtkPropCollection* props = renderer->GetViewProps();
  props->InitTraversal();
  while (vtkProp* prop = props->GetNextProp()) {
    auto* label = vtkBillboardTextActor3D::SafeDownCast(prop);
    const std::string text = label != nullptr ? label->GetInput() : "";
    feet += text.ends_with(" ft") ? 1 : 0;
    metres += text.ends_with(" m") ? 1 : 0;
  }
  EXPECT_EQ(feet, 1);
  EXPECT_EQ(metres, 0);
  EXPECT_THROW(view.Describe("cameras", 100000), InputError);
  const Eigen::Vector2d empty = Pixel({0, 0, 1.8});
  EXPECT_FALSE(view.Pick(renderer, empty.x(), empty.y()));
  EXPECT_THROW(view.SetVisible("panorama", false), OptionError);
  EXPECT_THROW(view.LookAtStation(renderer, "S9"), InputError);
  view.RemoveFrom(renderer);
}

TEST_F(SceneTest, AnEmptySceneAndMissingSigmasAreDrawn) {
  SceneModel empty;
  SceneView nothing(empty);
  nothing.AddTo(window_->renderer());
  nothing.LookDown(window_->renderer());
  EXPECT_FALSE(window_->Render(200, 100).empty());
  nothing.RemoveFrom(window_->renderer());
  SceneModel model = Ring();
  model.errors[0].sigma_m.reset();
  model.errors[1].sigma_m = Eigen::Vector3d::Constant(std::nan(""));
  for (ScenePoint& p : model.points) p.sigma_m = std::nan("");
  SceneStyle style;
  style.points = PointColour::kUncertainty;
  SceneView view(model, style);
  view.AddTo(window_->renderer());
  view.LookDown(window_->renderer());
  EXPECT_FALSE(window_->Render(200, 100).empty());
  view.RemoveFrom(window_->renderer());
}

}  // namespace
}  // namespace trigpoint
