// At which resolution a reference photo is matched with a run's images.
#include "localize/reconstruct/feature_store.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace trigpoint
