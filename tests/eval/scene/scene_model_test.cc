// What is read of a project for its scene.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "datasets/io/image.h"
#include "datasets/io/trajectory.h"
#include "eval/scene/offscreen.h"
#include "eval/scene/scene_view.h"
#include "tests/support/results_site.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

constexpr int kImages = 6;

std::vector<TimedPose> Bent(double by_m, const Rigid3d& moved = Rigid3d()) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < kImages; ++i) {
    const Rigid3d pose{Eigen::Quaterniond::Identity(), {0.3 * i, by_m * i * i, 1.5}};
    poses.push_back({1'000'000'000'000 + i * 500'000'000LL, moved * pose});
  }
  return poses;
}

const ScenePath* PathOf(const SceneModel& model, ScenePath::Kind kind) {
  for (const ScenePath& path : model.paths) {
    if (path.kind == kind) return &path;
  }
  return nullptr;
}

class SceneModelTest : public testing::Test {
 protected:
  SceneModelTest() { WriteResultsSite(dir_.path(), {.images = kImages, .points = 200, .panoramas = 1}); }
  SceneModel Load() const { return LoadScene(Project::Open(dir_.path())); }

  TempDir dir_;
};

TEST_F(SceneModelTest, TruthAndReferencePosesAreLayersOfTheirOwn) {
  const SceneModel without = Load();
  EXPECT_EQ(PathOf(without, ScenePath::Kind::kTruth), nullptr);
  EXPECT_EQ(PathOf(without, ScenePath::Kind::kReference), nullptr);
  EXPECT_FALSE(SceneView(without).HasContent("truth"));
  EXPECT_FALSE(SceneView(without).HasContent("reference"));
  const Rigid3d aside(Eigen::Quaterniond::Identity(), {0, 1, 0});
  WriteTum(dir_ / "truth/runs/run1_cameras.tum", Bent(0.05), {});
  WriteTum(dir_ / "results/reference/run1/cameras.tum", Bent(0.05, aside), {});
  const SceneModel model = Load();
  ASSERT_NE(PathOf(model, ScenePath::Kind::kTruth), nullptr);
  ASSERT_NE(PathOf(model, ScenePath::Kind::kReference), nullptr);
  EXPECT_NEAR(PathOf(model, ScenePath::Kind::kTruth)->poses[4].target_from_body.translation.y(), 0.8, 1e-9);
  EXPECT_NEAR(PathOf(model, ScenePath::Kind::kReference)->poses[4].target_from_body.translation.y(), 1.8, 1e-9);
  EXPECT_NE(SceneView::ColourOfLayer("truth"), SceneView::ColourOfLayer("reference"));
  std::string reason;
  const auto window = OffscreenWindow::Create(&reason);
  if (!window) GTEST_SKIP() << "no OpenGL here: " << reason;
  SceneView view(model);
  view.AddTo(window->renderer());
  window->Render(960, 640);
  view.LookDown(window->renderer());
  const size_t lines = view.LegendBoxes(window->renderer()).size();
  for (const char* layer : {"truth", "reference"}) {
    EXPECT_TRUE(view.Visible(layer));
    const cv::Mat with = window->Render(960, 640);
    view.SetVisible(layer, false);
    EXPECT_GT(cv::norm(window->Render(960, 640), with, cv::NORM_INF), 100) << layer;
  }
  EXPECT_EQ(view.LegendBoxes(window->renderer()).size(), lines - 2);
  view.RemoveFrom(window->renderer());
}

TEST_F(SceneModelTest, TruthIsTheOneThatWasScoredAgainst) {
  WriteTum(dir_ / "truth/runs/run1_cameras.tum", Bent(0.05), {});
  WriteTum(dir_ / "known/runs/run1_cameras.tum", Bent(0.1), {});
  dir_.Write("results/evaluate/manifest.json", R"({"schema": 1, "options": {"truth": "known"}})");
  const SceneModel model = Load();
  ASSERT_NE(PathOf(model, ScenePath::Kind::kTruth), nullptr);
  EXPECT_NEAR(PathOf(model, ScenePath::Kind::kTruth)->poses[4].target_from_body.translation.y(), 1.6, 1e-9);
}

TEST_F(SceneModelTest, WithoutAGeoreferenceTruthIsLaidOntoTheRun) {
  const Rigid3d world_from_odom(Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ())), {100, -50, 7});
  for (const char* file : {"cameras.csv", "cameras.tum"}) {
    std::filesystem::remove(dir_ / (std::string("results/localize/run1/") + file));
  }
  WriteTum(dir_ / "results/localize/run1/cameras_odom.tum", Bent(0.05), {});
  WriteTum(dir_ / "truth/runs/run1_cameras.tum", Bent(0.05, world_from_odom), {});
  const SceneModel model = Load();
  ASSERT_FALSE(model.on_earth);
  const ScenePath* truth = PathOf(model, ScenePath::Kind::kTruth);
  ASSERT_NE(truth, nullptr);
  EXPECT_EQ(truth->source, "truth, fitted rigidly");
  for (int i = 0; i < kImages; ++i) {
    const Eigen::Vector3d off = truth->poses[static_cast<size_t>(i)].target_from_body.translation -
                                Bent(0.05)[static_cast<size_t>(i)].target_from_body.translation;
    EXPECT_LT(off.norm(), 1e-6) << i;
  }
}

TEST_F(SceneModelTest, APointHasTheColourOfItsPixel) {
  const Project project = Project::Open(dir_.path());
  const SceneModel model = LoadScene(project);
  ASSERT_EQ(model.points.size(), 200U);
  ProgressSink silent;
  const auto colours = PointColoursOf(model, silent, {});
  const trigpoint::Run& run = project.run("run1");
  for (size_t i = 0; i < 20; ++i) {
    const ScenePoint& point = model.points[i];
    const cv::Mat picture = LoadColour(run, model.images[static_cast<size_t>(point.image)].entry);
    const auto& bgr = picture.at<cv::Vec3b>(static_cast<int>(std::lround(point.pixel.y())),
                                            static_cast<int>(std::lround(point.pixel.x())));
    EXPECT_EQ(colours[i], (std::array<uint8_t, 3>{bgr[2], bgr[1], bgr[0]})) << i;
  }
}

TEST(PointColours, AreThoseOfTheCamerasPartOfAPictureAndOfAVideo) {
  const TempDir dir;
  cv::Mat picture(40, 100, CV_8UC3, cv::Scalar(200, 100, 50));
  picture.at<cv::Vec3b>(15, 72) = cv::Vec3b(10, 20, 250);
  cv::imwrite((dir / "a.png").string(), picture);
  cv::VideoWriter video((dir / "b.avi").string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {100, 40});
  if (!video.isOpened()) GTEST_SKIP() << "this OpenCV writes no videos";
  for (int i = 0; i < 3; ++i) video.write(cv::Mat(40, 100, CV_8UC3, cv::Scalar(60.0 * i, 100, 30)));
  video.release();
  const auto run = std::make_shared<trigpoint::Run>();
  run->cameras.resize(2);
  run->cameras[0].camera = Camera::FromFieldOfView(100, 40, 1.0);
  run->cameras[1].camera = Camera::FromFieldOfView(50, 40, 1.0);
  run->cameras[1].part = {.kind = PicturePart::Kind::kCrop, .x = 50, .y = 0};
  SceneModel model;
  model.runs = {"run1"};
  model.images = {{run, {0, "b.avi#000002", dir / "b.avi", 0, 2}},
                  {run, {0, "a.png#cam1", dir / "a.png", 1, -1}},
                  {run, {0, "none.png", dir / "none.png", 0, -1}},
                  {}};
  for (int image = 0; image < 4; ++image) {
    ScenePoint& point = model.points.emplace_back();
    point.image = image, point.pixel = {22, 15};
  }
  ProgressSink silent;
  const auto colours = PointColoursOf(model, silent, {});
  ASSERT_EQ(colours.size(), 4U);
  const std::array<uint8_t, 3> red{250, 20, 10}, grey{160, 160, 160};
  EXPECT_NEAR(colours[0][0], 30, 8);
  EXPECT_NEAR(colours[0][1], 100, 8);
  EXPECT_NEAR(colours[0][2], 120, 8);
  EXPECT_EQ(colours[1], red);
  EXPECT_EQ(colours[2], grey);  // cannot be read
  EXPECT_EQ(colours[3], grey);
}

}  // namespace
}  // namespace trigpoint
