#include "survey/panorama/photo_features.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/camera/keypoint_order.h"
#include "calib/camera/pixel_convention.h"

namespace trigpoint {
namespace {

// Unit descriptors farther apart than 0.75 are no matches.
constexpr int kFarthest = static_cast<int>(0.75 * 0.75 * 255 * 255);

// By the product: sums of 16-bit products are what the processor does best.
int SquaredDistance(const PhotoFeatures& a, int i, const PhotoFeatures& b, int j) {
  const int16_t *x = a.row(i), *y = b.row(j);
  int product = 0;
  for (int k = 0; k < PhotoFeatures::kDim; ++k) product += x[k] * y[k];
  return a.squared_norms[static_cast<size_t>(i)] + b.squared_norms[static_cast<size_t>(j)] - 2 * product;
}

bool IsDistinct(const NearestTwo& found, double ratio) {
  return found.index >= 0 && found.best < kFarthest && found.best < ratio * ratio * static_cast<double>(found.second);
}

// Those that found each other.
PhotoMatches Mutual(const std::vector<NearestTwo>& of_a, const std::vector<NearestTwo>& of_b, double ratio) {
  PhotoMatches matches;
  for (size_t i = 0; i < of_a.size(); ++i) {
    if (!IsDistinct(of_a[i], ratio) || of_b[static_cast<size_t>(of_a[i].index)].index != static_cast<int>(i)) continue;
    matches.emplace_back(static_cast<int>(i), of_a[i].index);
  }
  return matches;
}

}  // namespace

PhotoFeatures FindPhotoFeatures(const ShrunkPicture& grey, int most, const std::optional<ImageCircle>& circle,
                                const cv::Mat& ignored) {
  const double full_per_pixel = grey.full_per_pixel.x();
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat sift, mask;
  if (circle) {
    mask = cv::Mat(grey.picture.size(), CV_8U, cv::Scalar(0));
    const Eigen::Vector2d centre = grey.FromFull(circle->centre);
    cv::circle(mask, cv::Point(static_cast<int>(std::lround(centre.x())), static_cast<int>(std::lround(centre.y()))),
               static_cast<int>(circle->radius_px / full_per_pixel), cv::Scalar(255), -1);
  }
  if (!ignored.empty()) {
    cv::Mat small;
    cv::resize(ignored, small, grey.picture.size(), 0, 0, cv::INTER_NEAREST);
    mask = mask.empty() ? small : cv::Mat(mask & small);
  }
  // A low contrast threshold: skies and lawns are what a panorama has to be tied over.
  cv::SIFT::create(most, 3, 0.02, 12, 1.6, CV_8U)->detectAndCompute(grey.picture, mask, keypoints, sift);
  PhotoFeatures features;
  for (int i : StrongestFirst(keypoints, Contrast)) {
    const cv::KeyPoint& k = keypoints[static_cast<size_t>(i)];
    features.points.emplace_back(grey.ToFull(FromOpenCvSiftPixel({k.pt.x, k.pt.y})).cast<float>());
    features.scales.push_back(static_cast<float>(0.5 * k.size * full_per_pixel));
    const uint8_t* row = sift.ptr<uint8_t>(i);
    const int sum = std::accumulate(row, row + PhotoFeatures::kDim, 0);
    int squared = 0;
    for (int c = 0; c < PhotoFeatures::kDim; ++c) {
      const long v = std::lround(255.0 * std::sqrt(sum > 0 ? static_cast<double>(row[c]) / sum : 0));
      features.descriptors.push_back(static_cast<int16_t>(v));
      squared += static_cast<int>(v * v);
    }
    features.squared_norms.push_back(squared);
  }
  return features;
}

PhotoMatches MatchStrongest(const PhotoFeatures& a, const PhotoFeatures& b, int most, double ratio) {
  const auto rows = [&](const PhotoFeatures& f) {
    return DescriptorRows{f.descriptors.data(), f.squared_norms.data(), std::min(f.size(), most)};
  };
  std::vector<NearestTwo> of_a, of_b;
  FindNearestBothWays(rows(a), rows(b), &of_a, &of_b);
  return Mutual(of_a, of_b, ratio);
}

PhotoMatches MatchPredicted(const PhotoFeatures& a, const PhotoFeatures& b,
                            const std::function<bool(const Eigen::Vector2f&, Eigen::Vector2d*)>& predict, double radius,
                            double ratio, double scale_ratio) {
  // b's features in cells of the radius' size.
  const auto cell = [&](double v) { return static_cast<int>(std::floor(v / radius)); };
  std::map<std::pair<int, int>, std::vector<int>> cells;
  for (int j = 0; j < b.size(); ++j) {
    const Eigen::Vector2f& p = b.points[static_cast<size_t>(j)];
    cells[{cell(p.x()), cell(p.y())}].push_back(j);
  }
  std::vector<NearestTwo> of_a(static_cast<size_t>(a.size())), of_b(static_cast<size_t>(b.size()));
  for (int i = 0; i < a.size(); ++i) {
    Eigen::Vector2d at;
    if (!predict(a.points[static_cast<size_t>(i)], &at)) continue;
    const double scale = a.scales[static_cast<size_t>(i)] * scale_ratio;
    for (int cy = cell(at.y() - radius); cy <= cell(at.y() + radius); ++cy) {
      for (int cx = cell(at.x() - radius); cx <= cell(at.x() + radius); ++cx) {
        const auto it = cells.find({cx, cy});
        if (it == cells.end()) continue;
        for (int j : it->second) {
          const double s = b.scales[static_cast<size_t>(j)];
          if (s > 1.6 * scale || scale > 1.6 * s) continue;
          if ((b.points[static_cast<size_t>(j)].cast<double>() - at).squaredNorm() > radius * radius) continue;
          const int d = SquaredDistance(a, i, b, j);
          of_a[static_cast<size_t>(i)].Offer(d, j);
          of_b[static_cast<size_t>(j)].Offer(d, i);
        }
      }
    }
  }
  return Mutual(of_a, of_b, ratio);
}

double ShareOfEqualFeatures(const PhotoFeatures& a, const PhotoFeatures& b) {
  if (a.size() == 0 || b.size() == 0) return 0;
  std::set<std::pair<float, float>> places;
  for (const Eigen::Vector2f& p : a.points) places.emplace(p.x(), p.y());
  int equal = 0;
  for (const Eigen::Vector2f& p : b.points) equal += places.count({p.x(), p.y()}) > 0 ? 1 : 0;
  return static_cast<double>(equal) / std::min(a.size(), b.size());
}

}  // namespace trigpoint
