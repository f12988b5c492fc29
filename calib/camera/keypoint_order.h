// The order of an image's keypoints.
#pragma once

#include <algorithm>
#include <numeric>
#include <opencv2/core/types.hpp>
#include <tuple>
#include <vector>

namespace trigpoint {

// Indices of keypoints, strongest first. A total order: the result does not depend on the detector's threads.
inline std::vector<int> StrongestFirst(const std::vector<cv::KeyPoint>& keypoints) {
  std::vector<int> order(keypoints.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int i, int j) {
    const cv::KeyPoint &a = keypoints[static_cast<size_t>(i)], &b = keypoints[static_cast<size_t>(j)];
    return std::tie(b.response, a.pt.x, a.pt.y, a.size, a.angle) <
           std::tie(a.response, b.pt.x, b.pt.y, b.size, b.angle);
  });
  return order;
}

}  // namespace trigpoint
