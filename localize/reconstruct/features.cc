#include "localize/reconstruct/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/features2d.hpp>

#include "calib/camera/keypoint_order.h"
#include "calib/camera/pixel_convention.h"
#include "calib/camera/shrunk_picture.h"
#include "calib/geo/geodetic.h"

namespace trigpoint {

namespace {

// Details finer than this are found only to be left out: pictures have a feature to keep in 40 to 250 pixels.
constexpr int kPixelsPerFeature = 1000;

// The longer side of a picture of the shape of `full` that has no more pixels than the features need.
int LongSide(const cv::Mat& full, int features) {
  const double share = static_cast<double>(kPixelsPerFeature) * features / static_cast<double>(full.total());
  return static_cast<int>(std::max(full.cols, full.rows) * std::sqrt(std::min(1.0, share)));
}

}  // namespace

FeatureSet ExtractFeatures(const cv::Mat& grey, const cv::Mat& mask, const FeatureOptions& options) {
  const ShrunkPicture small(grey, LongSide(grey, options.max_features));
  const float full_per_pixel = static_cast<float>(small.full_per_pixel.mean());
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(0, 3, options.contrast_threshold, options.edge_threshold, 1.6, CV_8U);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  // Together: the scale space is built once.
  sift->detectAndCompute(small.picture, ReducedMask(mask, small.picture.size()), keypoints, descriptors);
  std::vector<int> order = StrongestFirst(keypoints, ContrastOverError);
  order.resize(std::min(order.size(), static_cast<size_t>(options.max_features)));
  FeatureSet features;
  features.descriptors = cv::Mat::zeros(static_cast<int>(order.size()), 128, CV_8U);
  int row = 0;
  for (int i : order) {
    const cv::KeyPoint& k = keypoints[static_cast<size_t>(i)];
    features.points.push_back(small.ToFull(FromOpenCvSiftPixel({k.pt.x, k.pt.y})).cast<float>());
    features.scales.push_back(0.5F * k.size * full_per_pixel);
    features.angles.push_back(static_cast<float>(k.angle * kDegToRad));
    descriptors.row(i).copyTo(features.descriptors.row(row++));
  }
  return features;
}

cv::Mat RootSift(const cv::Mat& descriptors) {
  static const std::array<float, 256> kRoots = [] {
    std::array<float, 256> roots{};
    for (size_t v = 0; v < roots.size(); ++v) roots[v] = std::sqrt(static_cast<float>(v));
    return roots;
  }();
  cv::Mat out(descriptors.rows, descriptors.cols, CV_8U);
  for (int r = 0; r < descriptors.rows; ++r) {
    const uint8_t* in = descriptors.ptr<uint8_t>(r);
    uint8_t* to = out.ptr<uint8_t>(r);
    int sum = 0;
    for (int c = 0; c < descriptors.cols; ++c) sum += in[c];
    const float scale = sum > 0 ? 255.0F / std::sqrt(static_cast<float>(sum)) : 0.0F;
    for (int c = 0; c < descriptors.cols; ++c) {
      const float above = scale * kRoots[in[c]] + 0.5F;  // rounds
      to[c] = static_cast<uint8_t>(above);
    }
  }
  return out;
}

}  // namespace trigpoint
