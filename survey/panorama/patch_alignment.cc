#include "survey/panorama/patch_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace trigpoint {
namespace {

constexpr int kRadius = 8;              // of a patch, px of its level
constexpr int kSide = 2 * kRadius + 3;  // with a border for gradients
constexpr double kLargestScale = 6;     // px of a level: larger features are looked at one level up
constexpr double kBlur = 0.7;           // px, of the finest level: what interpolation would make of noise
constexpr double kFarthest = 2;         // px of the level: farther off it is another thing
constexpr double kFloor = 0.03;         // px of the level: no place is known better
constexpr double kLeastAlike = 0.7;     // normalised correlation
// Mean square slope of the noise that two patches differ by, share of its variance: each has half, blurred by kBlur.
constexpr double kNoiseSlope = 0.22;
constexpr int kIterations = 12;
constexpr double kConverged = 0.003;  // px

// Offsets of a patch's samples: a disc.
const std::vector<Eigen::Vector2i>& Disc() {
  static const std::vector<Eigen::Vector2i> disc = [] {
    std::vector<Eigen::Vector2i> all;
    for (int y = -kRadius; y <= kRadius; ++y) {
      for (int x = -kRadius; x <= kRadius; ++x) {
        if (x * x + y * y <= kRadius * kRadius) all.emplace_back(x, y);
      }
    }
    return all;
  }();
  return disc;
}

bool Inside(const cv::Mat& picture, const Eigen::Vector2d& at, double margin) {
  return at.x() >= margin && at.y() >= margin && at.x() + margin < picture.cols - 1 &&
         at.y() + margin < picture.rows - 1;
}

float Sample(const cv::Mat& picture, double x, double y) {
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const float u = static_cast<float>(x - i), v = static_cast<float>(y - j);
  const uint8_t *upper = picture.ptr<uint8_t>(j) + i, *lower = picture.ptr<uint8_t>(j + 1) + i;
  const float top = static_cast<float>(upper[0]) + u * static_cast<float>(upper[1] - upper[0]);
  const float bottom = static_cast<float>(lower[0]) + u * static_cast<float>(lower[1] - lower[0]);
  return top + v * (bottom - top);
}

// The samples of a disc about a centre.
struct Patch {
  std::vector<float> values;
  std::vector<Eigen::Vector2d> slopes;
  Eigen::Matrix2d texture = Eigen::Matrix2d::Zero();  // sum of the slopes' squares
  double mean = 0, square_sum = 0;                    // of the values; the squares about their mean

  Patch(const cv::Mat& from, const Eigen::Vector2d& centre) {
    Eigen::Matrix<float, kSide, kSide> square;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        square(y, x) = Sample(from, centre.x() + x - kRadius - 1, centre.y() + y - kRadius - 1);
      }
    }
    const std::vector<Eigen::Vector2i>& disc = Disc();
    const size_t n = disc.size();
    values.resize(n), slopes.resize(n);
    for (size_t k = 0; k < n; ++k) {
      const int y = disc[k].y() + kRadius + 1, x = disc[k].x() + kRadius + 1;
      values[k] = square(y, x);
      slopes[k] = 0.5 * Eigen::Vector2d(square(y, x + 1) - square(y, x - 1), square(y + 1, x) - square(y - 1, x));
      texture += slopes[k] * slopes[k].transpose();
      mean += values[k];
    }
    mean /= static_cast<double>(n);
    for (float v : values) square_sum += (v - mean) * (v - mean);
  }
};

struct Shift {
  Eigen::Vector2d d;
  double variance = 1;  // of what is left, grey levels^2
};

// d of a(x + d) = b(start - warp d + warp x), gain and offset apart; where the search began counts as a measurement of
// d = 0. Nothing if the patches do not look alike.
std::optional<Shift> FindShift(const Patch& patch, const cv::Mat& to, const Eigen::Vector2d& start,
                               const Eigen::Matrix2d& warp, double sigma) {
  Eigen::Vector2d d = Eigen::Vector2d::Zero();
  const std::vector<Eigen::Vector2i>& disc = Disc();
  const size_t n = disc.size();
  std::vector<float> seen(n);
  double alike = 0, variance = 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::Vector2d at = start - warp * d;
    double seen_mean = 0;
    for (size_t k = 0; k < n; ++k) {
      const Eigen::Vector2d p = at + warp * disc[k].cast<double>();
      seen[k] = Sample(to, p.x(), p.y());
      seen_mean += seen[k];
    }
    seen_mean /= static_cast<double>(n);
    double both = 0, seen_square = 0;
    for (size_t k = 0; k < n; ++k) {
      both += (patch.values[k] - patch.mean) * (seen[k] - seen_mean);
      seen_square += (seen[k] - seen_mean) * (seen[k] - seen_mean);
    }
    if (!(both > 0)) return std::nullopt;
    alike = both / std::sqrt(patch.square_sum * seen_square);
    const double gain = std::sqrt(patch.square_sum / seen_square);
    double left = 0;
    Eigen::Vector2d pull = Eigen::Vector2d::Zero();
    for (size_t k = 0; k < n; ++k) {
      const double r = gain * (seen[k] - seen_mean) - (patch.values[k] - patch.mean);
      left += r * r;
      pull += r * patch.slopes[k];
    }
    variance = std::max(1.0, left / static_cast<double>(n - 4));  // grey levels, not below one
    Eigen::Matrix2d information = patch.texture / variance;
    information.diagonal().array() += 1 / (sigma * sigma);
    const Eigen::Vector2d step = information.ldlt().solve(pull / variance - d / (sigma * sigma));
    d += step;
    if ((warp * d).norm() > kFarthest) return std::nullopt;
    if (step.norm() < kConverged) break;
  }
  if (alike < kLeastAlike) return std::nullopt;
  return Shift{d, variance};
}

}  // namespace

PatchImage::PatchImage(const ShrunkPicture& grey) : full_per_small_(grey.full_per_pixel) {
  cv::Mat level;
  cv::GaussianBlur(grey.picture, level, cv::Size(), kBlur);
  while (std::min(level.cols, level.rows) > 2 * kSide) {
    levels_.push_back(level);
    cv::Mat next;
    cv::pyrDown(level, next);  // pixel i of it is pixel 2 i
    level = next;
  }
}

Eigen::Vector2d PatchImage::ToLevel(const Eigen::Vector2d& pixel, int l) const {
  return ((pixel.array() + 0.5) / full_per_small_ - 0.5) / static_cast<double>(1 << l);
}

Eigen::Vector2d PatchImage::FromLevel(const Eigen::Vector2d& at, int l) const {
  return (at.array() * static_cast<double>(1 << l) + 0.5) * full_per_small_ - 0.5;
}

std::optional<PatchAlignment> AlignPatch(const PatchImage& a, const Eigen::Vector2d& pixel_a, const PatchImage& b,
                                         const Eigen::Vector2d& pixel_b, const Eigen::Matrix2d& b_from_a,
                                         double scale_px, double sigma) {
  if (a.empty() || b.empty()) return std::nullopt;
  const auto level_of = [](double scale, const PatchImage& image) {
    return std::clamp(static_cast<int>(std::ceil(std::log2(scale / image.FullPerLevel(0).x() / kLargestScale))), 0,
                      image.levels() - 1);
  };
  const double zoom = std::sqrt(std::abs(b_from_a.determinant()));
  const int la = level_of(scale_px, a), lb = level_of(scale_px * zoom, b);
  const cv::Mat &from = a.level(la), &to = b.level(lb);
  // Levels' pixels: b's move by `warp` when a's do by one.
  const Eigen::Matrix2d warp =
      b.FullPerLevel(lb).inverse().matrix().asDiagonal() * b_from_a * a.FullPerLevel(la).matrix().asDiagonal();
  const Eigen::Vector2d centre = a.ToLevel(pixel_a, la), start = b.ToLevel(pixel_b, lb);
  const double reach = kRadius * warp.cwiseAbs().rowwise().sum().maxCoeff() + kFarthest + 1;
  if (!Inside(from, centre, kRadius + 2) || !Inside(to, start, reach)) return std::nullopt;
  const Patch patch(from, centre);
  if (!(patch.square_sum > 0)) return std::nullopt;
  const std::optional<Shift> shift = FindShift(patch, to, start, warp, sigma);
  if (!shift) return std::nullopt;
  PatchAlignment out;
  out.pixel = b.FromLevel(start - warp * shift->d, lb);
  // Noise has slopes, too, and they hold nothing.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(patch.texture / shift->variance);
  const Eigen::Vector2d held =
      (axes.eigenvalues().array() - kNoiseSlope * static_cast<double>(Disc().size())).max(0) + 1 / (sigma * sigma);
  Eigen::Matrix2d of_level = axes.eigenvectors() * held.cwiseInverse().asDiagonal() * axes.eigenvectors().transpose();
  of_level.diagonal().array() += kFloor * kFloor;
  const Eigen::Matrix2d full = b_from_a * a.FullPerLevel(la).matrix().asDiagonal();
  out.covariance = full * of_level * full.transpose();
  return out;
}

}  // namespace trigpoint
