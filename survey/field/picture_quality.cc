#include "survey/field/picture_quality.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/base/median.h"

namespace trigpoint {
namespace {

constexpr int kDark = 8, kBright = 250;                // grey values
constexpr float kLowGradient = 4, kHighGradient = 12;  // grey values a pixel: what counts as an edge at least
constexpr float kNoises = 4;                           // and in sigmas of the gradient where there is none
constexpr size_t kLeastEdges = 100, kLeastCellEdges = 30;
constexpr double kReblur_px = 1;

struct EdgeBlurs {
  std::vector<double> all;
  std::array<std::vector<double>, kQualityCells * kQualityCells> cells;
};

// A gradient that noise and faint texture do not reach. Most of a picture is no edge.
float LeastGradient(const cv::Mat& picture) {
  constexpr int kEvery = 3;
  constexpr double kSigmaOfMedian = 1.4826;
  std::vector<double> sizes;
  for (int y = 0; y < picture.rows; y += kEvery) {
    const auto* p = picture.ptr<float>(y);
    for (int x = 1; x + 1 < picture.cols; x += kEvery) sizes.push_back(std::abs(0.5F * (p[x + 1] - p[x - 1])));
  }
  const auto noise = static_cast<float>(kSigmaOfMedian * Median(std::move(sizes)));
  return std::clamp(kNoises * noise, kLowGradient, kHighGradient);
}

// Edges across x; those across y are the ones of the transposed picture.
EdgeBlurs BlursAlongRows(const cv::Mat& picture, const cv::Mat& reblurred) {
  EdgeBlurs blurs;
  const float least = LeastGradient(picture);
  for (int y = 1; y + 1 < picture.rows; ++y) {
    const auto* p = picture.ptr<float>(y);
    const auto* q = reblurred.ptr<float>(y);
    const auto *above = picture.ptr<float>(y - 1), *below = picture.ptr<float>(y + 1);
    const auto gradient = [](const float* row, int x) { return 0.5F * (row[x + 1] - row[x - 1]); };
    for (int x = 2; x + 2 < picture.cols; ++x) {
      const float g = gradient(p, x), size = std::abs(g);
      if (size < least || size < std::abs(gradient(p, x - 1)) || size <= std::abs(gradient(p, x + 1))) continue;
      // Across the edge, not along one that is nearly level.
      if (0.5F * std::abs(below[x] - above[x]) > 0.4F * size) continue;
      const double ratio = g / gradient(q, x);
      if (!(ratio > 1.01 && ratio < 50)) continue;
      const double blur = kReblur_px / std::sqrt(ratio * ratio - 1);
      blurs.all.push_back(blur);
      const int cell = kQualityCells * (kQualityCells * y / picture.rows) + kQualityCells * x / picture.cols;
      blurs.cells[static_cast<size_t>(cell)].push_back(blur);
    }
  }
  return blurs;
}

size_t Transposed(size_t cell) { return kQualityCells * (cell % kQualityCells) + cell / kQualityCells; }

}  // namespace

PictureQuality MeasurePicture(const cv::Mat& grey) {
  PictureQuality quality;
  cv::Mat small = grey;
  const double shrink = static_cast<double>(kQualitySide_px) / std::max(grey.cols, grey.rows);
  if (shrink < 1) cv::resize(grey, small, {}, shrink, shrink, cv::INTER_AREA);
  const auto pixels = static_cast<double>(small.total());
  quality.mean = cv::mean(small)[0];
  quality.dark = cv::countNonZero(small <= kDark) / pixels;
  quality.bright = cv::countNonZero(small >= kBright) / pixels;
  cv::Mat picture, reblurred;
  small.convertTo(picture, CV_32F);
  cv::GaussianBlur(picture, reblurred, {}, kReblur_px);
  const EdgeBlurs upright = BlursAlongRows(picture, reblurred);
  const EdgeBlurs level = BlursAlongRows(picture.t(), reblurred.t());
  for (const EdgeBlurs* edges : {&upright, &level}) {
    if (edges->all.size() >= kLeastEdges) quality.blur_px = std::max(quality.blur_px.value_or(0), Median(edges->all));
  }
  for (size_t k = 0; k < quality.cell_blur_px.size(); ++k) {
    std::vector<double> both = upright.cells[k];
    const std::vector<double>& other = level.cells[Transposed(k)];
    both.insert(both.end(), other.begin(), other.end());
    if (both.size() >= kLeastCellEdges) quality.cell_blur_px[k] = Median(std::move(both));
  }
  return quality;
}

}  // namespace trigpoint
