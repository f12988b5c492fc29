// An image's features as matching wants them.
#pragma once

#include <memory>
#include <vector>

#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

struct PreparedImage {
  FeatureSet features;
  DescriptorBlock descriptors;        // RootSIFT; empty in paper mode
  std::vector<Eigen::Vector3d> rays;  // unit, camera frame; (0, 0, -1) where the lens has none
  std::unique_ptr<FeatureGrid> grid;
};

// Reads an image's features. Thread safe.
std::unique_ptr<PreparedImage> PrepareImage(const LocalizeInput& input, int image, bool paper);

}  // namespace trigpoint
