// Features of a set's photos and their matches. Pixels: the centre of the top-left pixel is (0, 0).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "calib/base/nearest_rows.h"
#include "calib/camera/shrunk_picture.h"
#include "survey/panorama/image_circle.h"

namespace trigpoint {

// RootSIFT (Arandjelovic & Zisserman 2012) features of one photo, strongest first.
struct PhotoFeatures {
  static constexpr int kDim = kDescriptorDim;
  std::vector<Eigen::Vector2f> points;  // px of the full picture
  std::vector<float> scales;            // px of the full picture
  std::vector<int16_t> descriptors;     // size() rows of kDim; each of length about 255
  std::vector<int> squared_norms;       // of the rows
  int size() const { return static_cast<int>(points.size()); }
  const int16_t* row(int i) const { return descriptors.data() + static_cast<size_t>(i) * kDim; }
};

// At most `most` features of a photo's 8-bit grey picture; of a fisheye's, only within its circle. `mask`: the whole
// picture in any size, 8-bit, 0 = ignored; may be empty. Thread safe.
PhotoFeatures FindPhotoFeatures(const ShrunkPicture& grey, int most, const std::optional<ImageCircle>& circle,
                                const cv::Mat& mask);

using PhotoMatches = std::vector<std::pair<int, int>>;  // feature of a, feature of b

// Mutual nearest neighbours among the first `most` of each, with a ratio test both ways.
PhotoMatches MatchStrongest(const PhotoFeatures& a, const PhotoFeatures& b, int most, double ratio);

// Mutual best matches near where `predict` says a feature of a appears in b (nothing: not there). `radius` px. Scales
// must agree within a factor of 1.6 of `scale_ratio` (scale in b / scale in a).
PhotoMatches MatchPredicted(const PhotoFeatures& a, const PhotoFeatures& b,
                            const std::function<bool(const Eigen::Vector2f&, Eigen::Vector2d*)>& predict, double radius,
                            double ratio, double scale_ratio);

// How many features two photos have at the very same places, as a share of the smaller number: 1 for copies.
double ShareOfEqualFeatures(const PhotoFeatures& a, const PhotoFeatures& b);

}  // namespace trigpoint
