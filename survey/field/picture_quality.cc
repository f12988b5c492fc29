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
constexpr int kMaskedEdge_px = 2;  // a mask's own edge, and what the blur carries over it
// Variance of a pixel's square, and of the difference over two pixels, px^2.
constexpr double kPixelVariance = 1.0 / 12, kDifferenceVariance = 4.0 / 12;
constexpr double kLeastResolved_px = 0.2;  // below it the gradients no longer depend on the blur
constexpr double kMostBlur_px = 50;

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
EdgeBlurs BlursAlongRows(const cv::Mat& picture, const cv::Mat& reblurred, const cv::Mat& mask) {
  EdgeBlurs blurs;
  const float least = LeastGradient(picture);
  for (int y = 1; y + 1 < picture.rows; ++y) {
    const auto* p = picture.ptr<float>(y);
    const auto* q = reblurred.ptr<float>(y);
    const auto *above = picture.ptr<float>(y - 1), *below = picture.ptr<float>(y + 1);
    const auto gradient = [](const float* row, int x) { return 0.5F * (row[x + 1] - row[x - 1]); };
    for (int x = 2; x + 2 < picture.cols; ++x) {
      const float g = gradient(p, x), size = std::abs(g);
      if (!mask.empty() && mask.at<uint8_t>(y, x) == 0) continue;
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

// What BlursAlongRows finds for a step that a Gaussian of `blur_px` blurred, with every position of the edge between
// the pixels equally likely. The central difference at a distance d from an edge of standard deviation s (the pixel's
// square included) is (erf((1 + d) / (sqrt(2) s)) + erf((1 - d) / (sqrt(2) s))) / 4 of the step. Local maxima have
// distances to 0.5, 0.25 in the median, and the ratio of the gradients falls with the distance.
double MedianFound(double blur_px) {
  const auto gradient = [](double variance) {
    const double scale = 1 / std::sqrt(2 * variance);
    return std::erf(1.25 * scale) + std::erf(0.75 * scale);
  };
  const double variance = blur_px * blur_px + kPixelVariance;
  const double ratio = gradient(variance) / gradient(variance + kReblur_px * kReblur_px);
  return kReblur_px / std::sqrt(ratio * ratio - 1);
}

// The blur of which `found` is the median, with the variances of sampling.
double SampledBlur(double found) {
  double low = kLeastResolved_px, high = kMostBlur_px;
  const auto sampled = [](double blur) { return std::sqrt(blur * blur + kPixelVariance + kDifferenceVariance); };
  if (found <= MedianFound(low)) return sampled(low) * found / MedianFound(low);
  constexpr int kHalvings = 40;
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    (MedianFound(middle) < found ? low : high) = middle;
  }
  return sampled(low);
}

GradientEnergy EnergyOf(const cv::Mat& picture, const cv::Mat& reblurred, const cv::Mat& mask) {
  GradientEnergy energy;
  energy.rows = std::max(1, cvRound(static_cast<double>(kEnergyColumns) * picture.rows / picture.cols));
  const auto cells = static_cast<size_t>(energy.rows * kEnergyColumns);
  energy.sharp.assign(cells, 0);
  energy.reblurred.assign(cells, 0);
  std::vector<float> pixels(cells, 0);
  const auto squared = [](const cv::Mat& p, int y, int x) {
    const float across = 0.5F * (p.at<float>(y, x + 1) - p.at<float>(y, x - 1));
    const float down = 0.5F * (p.at<float>(y + 1, x) - p.at<float>(y - 1, x));
    return across * across + down * down;
  };
  for (int y = 1; y + 1 < picture.rows; ++y) {
    for (int x = 1; x + 1 < picture.cols; ++x) {
      const auto cell =
          static_cast<size_t>(kEnergyColumns * (energy.rows * y / picture.rows) + kEnergyColumns * x / picture.cols);
      ++pixels[cell];
      if (!mask.empty() && mask.at<uint8_t>(y, x) == 0) continue;
      energy.sharp[cell] += squared(picture, y, x);
      energy.reblurred[cell] += squared(reblurred, y, x);
    }
  }
  for (size_t k = 0; k < cells; ++k) {
    energy.sharp[k] /= std::max(1.F, pixels[k]);
    energy.reblurred[k] /= std::max(1.F, pixels[k]);
  }
  return energy;
}

size_t Transposed(size_t cell) { return kQualityCells * (cell % kQualityCells) + cell / kQualityCells; }

}  // namespace

PictureQuality MeasurePicture(const cv::Mat& grey, const cv::Mat& mask) {
  PictureQuality quality;
  cv::Mat small = grey, counts = mask;
  const double shrink = static_cast<double>(kQualitySide_px) / std::max(grey.cols, grey.rows);
  if (shrink < 1) cv::resize(grey, small, {}, shrink, shrink, cv::INTER_AREA);
  if (!mask.empty()) {
    if (shrink < 1) cv::resize(mask, counts, small.size(), 0, 0, cv::INTER_NEAREST);
    cv::erode(counts, counts, cv::Mat(), {-1, -1}, kMaskedEdge_px);
  }
  const auto share = [&](const cv::Mat& which) {
    const cv::Mat counted = counts.empty() ? which : which & counts;
    const auto all = static_cast<double>(counts.empty() ? small.total() : cv::countNonZero(counts));
    return all > 0 ? cv::countNonZero(counted) / all : 0;
  };
  quality.mean = cv::mean(small, counts)[0];
  quality.dark = share(small <= kDark);
  quality.bright = share(small >= kBright);
  cv::Mat picture, reblurred;
  small.convertTo(picture, CV_32F);
  cv::GaussianBlur(picture, reblurred, {}, kReblur_px);
  quality.energy = EnergyOf(picture, reblurred, counts);
  const EdgeBlurs upright = BlursAlongRows(picture, reblurred, counts);
  const EdgeBlurs level = BlursAlongRows(picture.t(), reblurred.t(), counts.empty() ? counts : counts.t());
  for (const EdgeBlurs* edges : {&upright, &level}) {
    if (edges->all.size() >= kLeastEdges) {
      quality.blur_px = std::max(quality.blur_px.value_or(0), SampledBlur(Median(edges->all)));
    }
  }
  for (size_t k = 0; k < quality.cell_blur_px.size(); ++k) {
    std::vector<double> both = upright.cells[k];
    const std::vector<double>& other = level.cells[Transposed(k)];
    both.insert(both.end(), other.begin(), other.end());
    if (both.size() >= kLeastCellEdges) quality.cell_blur_px[k] = SampledBlur(Median(std::move(both)));
  }
  return quality;
}

}  // namespace trigpoint
