#include "survey/panorama/distance_field.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace trigpoint {
namespace {

constexpr int kWidth = 360, kHeight = 180;
constexpr double kPi = std::numbers::pi;
constexpr double kNearest = 1.0;  // 1/m: nothing is shown as nearer than a metre
constexpr double kOwn = 0.05;     // 1/m: how much neighbouring points differ

}  // namespace

DistanceField::DistanceField(const RigState& state) {
  struct Sample {
    int x, y;
    double inverse_distance, weight;
  };
  std::vector<Sample> samples;
  for (const RigPoint& p : state.points) {
    if (!(p.sigma > 0) || p.sigma > 1) continue;
    const double azimuth = std::atan2(p.direction.x(), p.direction.z());
    const double elevation = std::asin(std::clamp(-p.direction.y(), -1.0, 1.0));
    samples.push_back({static_cast<int>((azimuth / (2 * kPi) + 0.5) * kWidth) % kWidth,
                       std::min(kHeight - 1, static_cast<int>((0.5 - elevation / kPi) * kHeight)),
                       std::clamp(p.inverse_distance, 0.0, kNearest), 1 / (p.sigma * p.sigma + kOwn * kOwn)});
  }
  // Sums in cells of a degree, blurred from coarse to fine: where the fine one has no points, the coarse one is used.
  // A point far from the coarser field counts little: a near object shows many points, a wrong match is alone.
  cv::Mat field = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  for (const double sigma_deg : {30.0, 12.0, 5.0, 2.0}) {
    cv::Mat sums = cv::Mat::zeros(kHeight, kWidth, CV_64F), weights = cv::Mat::zeros(kHeight, kWidth, CV_64F);
    for (const Sample& s : samples) {
      const double said = field.at<float>(s.y, s.x), off = (s.inverse_distance - said) / (kOwn + said);
      const double weight = s.weight / (1 + off * off);
      sums.at<double>(s.y, s.x) += weight * s.inverse_distance;
      weights.at<double>(s.y, s.x) += weight;
    }
    // Round the ends: padded by three sigmas of what lies on the other side.
    const int pad = std::min(kWidth / 2, static_cast<int>(3 * sigma_deg));
    const auto blurred = [&](const cv::Mat& grid) {
      cv::Mat wide;
      cv::copyMakeBorder(grid, wide, 0, 0, pad, pad, cv::BORDER_WRAP);
      cv::GaussianBlur(wide, wide, cv::Size(), sigma_deg, sigma_deg, cv::BORDER_REFLECT);
      // Sums of points, not means: times the area under the bell.
      return cv::Mat(2 * kPi * sigma_deg * sigma_deg * wide(cv::Rect(pad, 0, kWidth, kHeight)));
    };
    const cv::Mat s = blurred(sums), w = blurred(weights);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        // The coarse value counts as one point of middling quality.
        const double prior = 1 / (0.1 * 0.1);
        float& f = field.at<float>(y, x);
        f = static_cast<float>((s.at<double>(y, x) + prior * f) / (w.at<double>(y, x) + prior));
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
