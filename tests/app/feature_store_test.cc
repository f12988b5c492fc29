// At which resolution a reference photo is matched with a run's images, and which features are found anew.
#include "localize/reconstruct/feature_store.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "calib/estimation/random.h"
#include "datasets/io/panorama_writer.h"
#include "datasets/io/text.h"
#include "datasets/project/hash.h"
#include "tests/support/temp_dir.h"

namespace trigpoint {
namespace {

Camera Pinhole(int width, int height, double focal) {
  return Camera(CameraModel::kPinhole, width, height, {focal, focal, 0.5 * (width - 1), 0.5 * (height - 1)});
}

Site SiteWithCamera(double focal) {
  Site site;
  Run run;
  BodyCamera camera;
  camera.camera = Pinhole(960, 600, focal);
  run.cameras = {camera};
  site.runs = {run};
  return site;
}

TEST(MatchedCamera, ReducesPhotosThatAreFarFinerThanTheRunsCameras) {
  const Camera matched = MatchedCamera(SiteWithCamera(400), Pinhole(1600, 1200, 1300));
  EXPECT_NEAR(matched.MeanFocal(), 520, 1);
  EXPECT_EQ(matched.width(), 640);
  EXPECT_EQ(matched.height(), 480);
}

TEST(MatchedCamera, LeavesOthersAsTheyAre) {
  EXPECT_EQ(MatchedCamera(SiteWithCamera(400), Pinhole(640, 480, 500)).width(), 640);
  EXPECT_EQ(MatchedCamera(Site(), Pinhole(1600, 1200, 1300)).width(), 1600);
}

// What is found in the reduced picture lies on the same ray in the picture as it is.
TEST(ResizedFeatures, KeepTheirRays) {
  const Camera photo = Pinhole(1601, 1203, 1300);
  const Camera matched = MatchedCamera(SiteWithCamera(400), photo);
  FeatureSet found;
  found.points = {{0, 0}, {333.25F, 77.5F}, {639, 480}};
  found.scales = {2, 4, 8};
  found.angles = {0, 1, 2};
  const FeatureSet stored = ResizedFeatures(found, matched, photo);
  for (size_t i = 0; i < found.points.size(); ++i) {
    const auto a = matched.Unproject(found.points[i].cast<double>());
    const auto b = photo.Unproject(stored.points[i].cast<double>());
    ASSERT_TRUE(a && b);
    EXPECT_LT((*a - *b).norm(), 1e-6);
    EXPECT_NEAR(stored.scales[i] / found.scales[i], 2.5, 0.01);
  }
  const FeatureSet again = ResizedFeatures(stored, photo, matched);
  for (size_t i = 0; i < found.points.size(); ++i) EXPECT_LT((again.points[i] - found.points[i]).norm(), 1e-3);
}

cv::Mat Noise(int width, int height, uint64_t seed) {
  Random random(seed);
  cv::Mat picture(height, width, CV_8U);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) picture.at<uint8_t>(y, x) = static_cast<uint8_t>(random.Uniform(0, 255));
  }
  return picture;
}

// The camera of a set is that of its first photo; the other was held upright.
TEST(PrepareReferences, TakesPhotosOfASetAsTheyWereHeld) {
  const TempDir dir;
  Site site = SiteWithCamera(150);
  site.dir = dir.path();
  Reference& set = site.references.emplace_back();
  set.kind = ReferenceKind::kPhotoSet;
  set.camera = Pinhole(160, 120, 150);
  for (const auto& [name, size] : {std::pair("a.png", cv::Size(160, 120)), {"b.png", cv::Size(120, 160)}}) {
    ASSERT_TRUE(cv::imwrite((dir / name).string(), Noise(size.width, size.height, set.files.size() + 1)));
    set.files.push_back(dir / name);
  }
  const std::vector<PreparedReference> prepared = PrepareReferences(site, {}, nullptr);
  ASSERT_EQ(prepared.size(), 2u);
  const Camera& upright = prepared[1].rig.views.at(0).camera;
  EXPECT_EQ(upright.width(), 120);
  EXPECT_EQ(upright.height(), 160);
  EXPECT_EQ(upright.MeanFocal(), 150);
  std::filesystem::create_directories(dir / "out");
  ProgressSink progress;
  const ExtractionReport report = ExtractReferenceFeatures(site, {}, {}, dir / "out", 1, progress, {});
  EXPECT_EQ(report.pictures, 2);
  EXPECT_TRUE(report.skipped.empty());
}

// A smaller copy keeps the tags of the panorama it was made from; its views have its own resolution.
TEST(PrepareReferences, ViewsHaveTheResolutionOfTheFile) {
  const TempDir dir;
  Site site;
  site.dir = dir.path();
  Reference& panorama = site.references.emplace_back();
  panorama.files = {dir / "a.jpg"};
  ASSERT_TRUE(cv::imwrite((dir / "a.jpg").string(), Noise(512, 256, 1)));
  PanoramaMetadata larger;
  larger.width = 2048, larger.height = 1024;
  WritePanoramaMetadata(dir / "a.jpg", larger);
  const std::vector<PreparedReference> prepared = PrepareReferences(site, {}, nullptr);
  ASSERT_EQ(prepared.size(), 1u);
  EXPECT_EQ(prepared[0].rig.views.at(0).camera.width(), FullSizeOfView(512, {}));
}

// A run of four small pictures of noise.
class FourPictures {
 public:
  FourPictures() {
    run.dir = dir.path();
    run.cameras = {BodyCamera{}};
    run.cameras[0].camera = Pinhole(160, 120, 150);
    for (int i = 0; i < 4; ++i) {
      ImageEntry& entry = run.images.emplace_back();
      entry.file = std::to_string(i) + ".png", entry.path = dir.path() / entry.file;
      Draw(i, 1);
    }
  }
  void Draw(int image, uint64_t seed) const {
    const cv::Mat picture = Noise(160, 120, 10 * static_cast<uint64_t>(image) + seed);
    cv::imwrite((dir.path() / (std::to_string(image) + ".png")).string(), picture);
  }
  // Into folder `to`, with what folder `before` holds ("": nothing).
  ExtractionReport Extract(const std::string& to, const std::string& before) const {
    std::filesystem::create_directories(dir.path() / to);
    ProgressSink progress;
    return ExtractRunFeatures(run, options, {before.empty() ? "" : dir.path() / before, Sha256OfFile}, dir.path() / to,
                              1, progress, {});
  }
  std::string Database(const std::string& folder) const { return ReadTextFile(dir.path() / folder / "features.db"); }

  TempDir dir;
  Run run;
  FeatureOptions options;
};

TEST(FeaturesBefore, AreKeptForPicturesThatAreAsTheyWere) {
  FourPictures site;
  EXPECT_EQ(site.Extract("a", "").kept, 0);
  EXPECT_EQ(site.Extract("b", "a").kept, 4);
  EXPECT_EQ(site.Database("a"), site.Database("b"));
  site.Draw(2, 7);
  site.run.images.erase(site.run.images.begin());
  const ExtractionReport changed = site.Extract("c", "b");
  EXPECT_EQ(changed.pictures, 3);
  EXPECT_EQ(changed.kept, 2);
  site.Extract("d", "");
  EXPECT_EQ(site.Database("c"), site.Database("d")) << "as if there had been nothing before";
}

TEST(FeatureStore, ListsTheNamesOfEachDatabaseInItsOrder) {
  FourPictures site;
  std::swap(site.run.images[0], site.run.images[3]);
  site.Extract("a", "");
  site.run.images.resize(2);
  std::swap(site.run.images[0], site.run.images[1]);
  site.Extract("b", "");
  const std::vector<std::string> a = {"3.png", "1.png", "2.png", "0.png"}, b = {"1.png", "3.png"};
  EXPECT_EQ(FeatureStore(site.dir.path() / "a" / kFeaturesFile).names(), a);
  EXPECT_EQ(FeatureStore(site.dir.path() / "b" / kFeaturesFile).names(), b);
  const std::vector<std::filesystem::path> both = {site.dir.path() / "b" / kFeaturesFile,
                                                   site.dir.path() / "a" / kFeaturesFile};
  EXPECT_EQ(FeatureStore(both).names(), (std::vector<std::string>{"1.png", "3.png", "2.png", "0.png"}));
}

TEST(FeaturesBefore, AreNotKeptUnderOtherConditions) {
  FourPictures site;
  site.Extract("a", "");
  site.options.max_features = 60;
  EXPECT_EQ(site.Extract("b", "a").kept, 0);
  site.options = {};
  site.run.config.mirrored = true;
  EXPECT_EQ(site.Extract("c", "a").kept, 0);
  site.run.config.mirrored = false;
  site.run.cameras[0].mask.boxes_px = {{10, 10, 50, 50}};
  EXPECT_EQ(site.Extract("d", "a").kept, 0);
  EXPECT_EQ(site.Extract("e", "d").kept, 4);
}

// One mask of the folder that does not fit refuses the run, as `detect` does.
TEST(Features, AreNotTakenWithAMaskOfAnotherSize) {
  FourPictures site;
  const std::filesystem::path masks = site.run.images[1].path.parent_path() / "masks";
  std::filesystem::create_directories(masks);
  const std::string name = std::filesystem::path(site.run.images[1].file).replace_extension(".png").string();
  cv::imwrite((masks / name).string(), cv::Mat(10, 10, CV_8U, cv::Scalar(255)));
  site.run.cameras[0].mask.folders = {masks};
  try {
    site.Extract("a", "");
    ADD_FAILURE() << "expected an error";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("expected a mask of"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace trigpoint
