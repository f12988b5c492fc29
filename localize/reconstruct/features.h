// Local features: SIFT, those of each image that are the clearest for their scale.
#pragma once

#include <opencv2/core/mat.hpp>

#include "calib/base/option.h"
#include "datasets/colmap/database.h"

namespace trigpoint {

struct FeatureOptions {
  int max_features = 4000;           // features kept an image, the clearest for their scale
  double contrast_threshold = 0.03;  // SIFT contrast threshold; lower finds more, weaker features
  double edge_threshold = 10;        // SIFT edge threshold

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_features,
          {"max_features", "", 50, 50000,
           "features kept of each image, the clearest for their scale; pictures of more than 1,000 pixels for each "
           "are reduced"});
    visit(self.contrast_threshold, {"contrast_threshold", "", 0.001, 0.2, "SIFT contrast threshold"});
    visit(self.edge_threshold, {"edge_threshold", "", 1, 100, "SIFT edge threshold"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// Features of an 8-bit grey image; `mask` (8-bit, 0 = ignore) may be empty. Our pixels, those of the image as it is.
// Deterministic; thread safe.
FeatureSet ExtractFeatures(const cv::Mat& grey, const cv::Mat& mask, const FeatureOptions& options);

// RootSIFT (Arandjelovic & Zisserman 2012) of 8-bit SIFT: sqrt of the L1-normalised descriptor, scaled to 8 bits
// (times 255: the L2 norm is 255).
cv::Mat RootSift(const cv::Mat& descriptors);

}  // namespace trigpoint
