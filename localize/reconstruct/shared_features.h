// How much two pictures share, quickly: for checks on site, not for estimates.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/camera/camera.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

struct SharedFeatureOptions {
  int side_px = 640;  // longer side at which features are looked for
  int features = 600;
  double ratio = 0.8;  // ratio test: best / second-best distance
  int ransac_iterations = 300;
};

// Of one picture.
struct QuickFeatures {
  DescriptorBlock descriptors;
  std::vector<Eigen::Vector3d> rays;  // camera frame, unit
  double pixel_rad = 0;               // of the shrunk picture
};
// `grey`: 8-bit, of the camera's size; so is `mask` (datasets/io/mask.h; empty: nothing is ignored). Thread safe.
QuickFeatures FindQuickFeatures(const cv::Mat& grey, const cv::Mat& mask, const Camera& camera,
                                const SharedFeatureOptions& options);

struct SharedView {
  // Matches that agree with one relative pose, or, where none is found, that lie where they lay; 0 where chance could
  // have made them.
  int features = 0;
  std::optional<Eigen::Quaterniond> b_from_a;  // rotation of that pose; none without one
  // Of its translation, unit length, where the matches show it to a few degrees, and its 1 sigma.
  std::optional<Eigen::Vector3d> direction;
  double sigma_direction_rad = 0;
  int matches = 0;  // mutual and distinct, whether they agree with a pose or not
};
// Deterministic; thread safe.
SharedView CompareViews(const QuickFeatures& a, const QuickFeatures& b, const SharedFeatureOptions& options);

}  // namespace trigpoint
