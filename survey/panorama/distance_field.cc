#include "survey/panorama/distance_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace trigpoint {
namespace {

constexpr int kWidth = 360, kHeight = 180;
constexpr double kPi = std::numbers::pi;

}  // namespace

DistanceField::DistanceField(const RigState& state) {
  // Weighted sums over the sphere, from coarse to fine: where the fine one has nothing, the coarse one speaks.
  cv::Mat field = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  for (const double sigma_deg : {30.0, 12.0, 5.0, 2.0}) {
    cv::Mat sum = cv::Mat::zeros(kHeight, kWidth, CV_64F), weights = cv::Mat::zeros(kHeight, kWidth, CV_64F);
    const double limit = 3 * sigma_deg;
    for (const RigPoint& p : state.points) {
      if (!(p.sigma > 0) || p.sigma > 1) continue;
      const double azimuth = std::atan2(p.direction.x(), p.direction.z()) * 180 / kPi;
      const double elevation = std::asin(std::clamp(-p.direction.y(), -1.0, 1.0)) * 180 / kPi;
      const double weight = 1 / (p.sigma * p.sigma + 1e-4);
      const int y0 = std::max(0, static_cast<int>(90 - elevation - limit)),
                y1 = std::min(kHeight - 1, static_cast<int>(90 - elevation + limit));
      for (int y = y0; y <= y1; ++y) {
        const double e = 90 - (y + 0.5);
        const double c = std::max(0.05, std::cos(e * kPi / 180));
        const int reach = std::min(kWidth / 2, static_cast<int>(limit / c) + 1);
        for (int dx = -reach; dx < reach; ++dx) {
          const int x = static_cast<int>(std::floor(azimuth + 180)) + dx;
          const double da = (x + 0.5 - 180 - azimuth) * c, de = e - elevation;
          const double d2 = (da * da + de * de) / (sigma_deg * sigma_deg);
          if (d2 > 9) continue;
          const double w = weight * std::exp(-0.5 * d2);
          const int at = ((x % kWidth) + kWidth) % kWidth;
          sum.at<double>(y, at) += w * p.inverse_distance;
          weights.at<double>(y, at) += w;
        }
      }
    }
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        // The coarse value counts as one point of middling quality.
        const double prior = 1 / (0.1 * 0.1);
        float& f = field.at<float>(y, x);
        f = static_cast<float>((sum.at<double>(y, x) + prior * f) / (weights.at<double>(y, x) + prior));
      }
    }
  }
  grid_ = field;
}

double DistanceField::InverseDistance(double azimuth, double elevation) const {
  if (grid_.empty()) return 0;
  const double x = (azimuth / (2 * kPi) + 0.5) * kWidth - 0.5;
  const double y = std::clamp((0.5 - elevation / kPi) * kHeight - 0.5, 0.0, kHeight - 1.001);
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(y);
  const double fx = x - x0, fy = y - y0;
  const auto at = [&](int yy, int xx) {
    return static_cast<double>(grid_.at<float>(yy, ((xx % kWidth) + kWidth) % kWidth));
  };
  return (1 - fy) * ((1 - fx) * at(y0, x0) + fx * at(y0, x0 + 1)) +
         fy * ((1 - fx) * at(y0 + 1, x0) + fx * at(y0 + 1, x0 + 1));
}

}  // namespace trigpoint
