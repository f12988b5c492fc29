// Features of pictures that are mirrored, and panoramas of such pictures.
#include "localize/references/mirrored.h"

#include <gmock/gmock.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/estimation/random.h"
#include "localize/reconstruct/features.h"

namespace trigpoint {
namespace {

// A picture of blurred noise has features everywhere.
cv::Mat Picture() {
  cv::Mat picture(240, 320, CV_8U);
  Random random(1);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) picture.at<uint8_t>(y, x) = static_cast<uint8_t>(random.Uniform(0, 255));
  }
  cv::GaussianBlur(picture, picture, {}, 2.5);
  cv::normalize(picture, picture, 0, 255, cv::NORM_MINMAX);
  return picture;
}

// Share of the features of `a` that `b` has at the same place, with nearly the same descriptor.
double ShareFound(const FeatureSet& a, const FeatureSet& b) {
  constexpr double kNear_px = 0.5, kAlike = 120;  // of descriptors whose length is 512
  int found = 0;
  for (size_t i = 0; i < a.points.size(); ++i) {
    for (size_t j = 0; j < b.points.size(); ++j) {
      if ((a.points[i] - b.points[j]).norm() > kNear_px) continue;
      if (cv::norm(a.descriptors.row(static_cast<int>(i)), b.descriptors.row(static_cast<int>(j))) > kAlike) continue;
      ++found;
      break;
    }
  }
  return static_cast<double>(found) / static_cast<double>(a.points.size());
}

TEST(MirroredFeatures, AreThoseOfTheMirroredPicture) {
  const cv::Mat picture = Picture();
  cv::Mat flipped;
  cv::flip(picture, flipped, 1);
  const FeatureSet features = ExtractFeatures(picture, {}, {});
  const FeatureSet of_flipped = ExtractFeatures(flipped, {}, {});
  ASSERT_GT(features.points.size(), 200U);
  // Not all: where two orientations are nearly as strong, noise decides which is taken.
  EXPECT_GT(ShareFound(MirroredFeatures(of_flipped, picture.cols), features), 0.8);
  EXPECT_LT(ShareFound(of_flipped, features), 0.1);
}

TEST(MirroredFeatures, MirroredTwiceAreAsBefore) {
  const FeatureSet features = ExtractFeatures(Picture(), {}, {});
  const FeatureSet twice = MirroredFeatures(MirroredFeatures(features, 320), 320);
  EXPECT_EQ(cv::norm(features.descriptors, twice.descriptors, cv::NORM_INF), 0);
  for (size_t i = 0; i < features.points.size(); ++i) {
    EXPECT_NEAR((features.points[i] - twice.points[i]).norm(), 0, 1e-3);
  }
}

}  // namespace
}  // namespace trigpoint
