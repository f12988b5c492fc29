#include "localize/reconstruct/patch.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace trigpoint {
namespace {

constexpr double kBlur = 0.7;               // sigma, px: less, and linear interpolation between pixels shows
constexpr float kLeastContrast = 2;         // grey values, standard deviation: about the noise of a picture
constexpr float kMostShift = 3;             // px; farther away is another feature
constexpr float kLeastGain = 0.3F;          // of contrast
constexpr float kLeastCorrelation = 0.7F;   // of pictures that show the same
constexpr double kLeastDeterminant = 0.05;  // of warps; smaller ones have collapsed
constexpr double kSlant = 1.5;              // tangent of a surface's slant, 1 sigma before pictures are seen
constexpr float kGreyVariance = 1;          // at least, of a sample: 8 bits and their noise
constexpr int kIterations = 20;
constexpr float kConverged = 0.005F;  // px

float At(const cv::Mat& picture, const Eigen::Vector2f& p) {
  const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
  const float *upper = picture.ptr<float>(y) + x, *lower = picture.ptr<float>(y + 1) + x;
  const float dx = p.x() - static_cast<float>(x), dy = p.y() - static_cast<float>(y);
  return (1 - dy) * (upper[0] + dx * (upper[1] - upper[0])) + dy * (lower[0] + dx * (lower[1] - lower[0]));
}

bool IsInside(const cv::Mat& picture, const Eigen::Vector2f& p) {
  return p.x() >= 0 && p.y() >= 0 && p.x() < static_cast<float>(picture.cols - 1) &&
         p.y() < static_cast<float>(picture.rows - 1);
}

// Whether all samples of a patch lie inside: those of its corners do.
bool HasRoom(const cv::Mat& picture, const Eigen::Vector2f& middle, const Eigen::Matrix2f& from_grid, float half) {
  for (const auto& [x, y] :
       {std::pair(-half, -half), std::pair(-half, half), std::pair(half, -half), std::pair(half, half)}) {
    if (!IsInside(picture, middle + from_grid * Eigen::Vector2f(x, y))) return false;
  }
  return true;
}

Eigen::Vector2f Grid(int x, int y) { return {static_cast<float>(x), static_cast<float>(y)}; }

}  // namespace

cv::Mat SmoothForPatches(const cv::Mat& grey) {
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {0, 0}, kBlur);
  return smooth;
}

double PatchRadius(float scale) {
  constexpr double kScales = 4;                         // half a side in scales of the feature, as SIFT's
  constexpr double kLeastRadius = 5, kMostRadius = 12;  // px; smaller ones show too little, larger ones are not plane
  return std::clamp(kScales * static_cast<double>(scale), kLeastRadius, kMostRadius);
}

bool Patch::Cut(const cv::Mat& smooth, const Eigen::Vector2f& pixel, double radius_px, double depth_per_px) {
  constexpr int kStored = kSide + 2;  // gradients take one more sample on each side
  step_ = static_cast<float>(radius_px / kHalf);
  if (!HasRoom(smooth, pixel, step_ * Eigen::Matrix2f::Identity(), kHalf + 1)) return false;
  Eigen::Matrix<float, kStored, kStored> grey;
  for (int y = 0; y < kStored; ++y) {
    for (int x = 0; x < kStored; ++x) grey(y, x) = At(smooth, pixel + step_ * Grid(x - kHalf - 1, y - kHalf - 1));
  }
  for (int y = 0, k = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++k) {
      values_(k) = grey(y + 1, x + 1);
      gradient_(k, 0) = (grey(y + 1, x + 2) - grey(y + 1, x)) / (2 * step_);
      gradient_(k, 1) = (grey(y + 2, x + 1) - grey(y, x + 1)) / (2 * step_);
    }
  }
  values_.array() -= values_.mean();
  energy_ = values_.squaredNorm();
  slope_.setZero();
  slope_information_ = Eigen::Matrix2d::Identity() / std::pow(kSlant * depth_per_px, 2);
  return energy_ > kLeastContrast * kLeastContrast * static_cast<float>(values_.size());
}

std::optional<float> Patch::Align(const cv::Mat& smooth, const SurfaceWarp& warp, Eigen::Vector2f* pixel) {
  return AlignAt(smooth, warp, nullptr, pixel);
}

std::optional<float> Patch::AlignPlane(const cv::Mat& smooth, const SurfaceWarp& warp, const ExpectedPlane& plane,
                                       Eigen::Vector2f* pixel) {
  slope_ = plane.slope;
  const Eigen::Matrix2d linear = warp.facing + warp.depth * slope_.transpose();
  Bend bend;
  for (int y = 0, k = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++k) {
      const Eigen::Vector2d px = (step_ * Grid(x - kHalf, y - kHalf)).cast<double>();
      bend.col(k) = (plane.shown(px) - linear * px).cast<float>();
    }
  }
  if (!bend.allFinite()) return {};
  return AlignAt(smooth, warp, &bend, pixel);
}

std::optional<float> Patch::AlignAt(const cv::Mat& smooth, const SurfaceWarp& warp, const Bend* bend,
                                    Eigen::Vector2f* pixel) {
  Place place{{}, *pixel, bend};
  Eigen::Vector2d slope = slope_;
  Eigen::Matrix2d information;
  // What a plane and the geometry say comes first: few parameters find it from farther away. What remains follows the
  // viewpoint, as surfaces are not plane; so at the end the warp is free.
  if (!AlignSurface(smooth, warp, *pixel, &place, &slope, &information)) return {};
  const std::optional<float> correlation = AlignFreely(smooth, *pixel, &place);
  if (!correlation) return {};
  *pixel = place.pixel;
  slope_ = slope;
  slope_information_ += information;
  return correlation;
}

// Of the place and of the surface's slope; this with what the pictures before have shown.
bool Patch::AlignSurface(const cv::Mat& smooth, const SurfaceWarp& warp, const Eigen::Vector2f& start, Place* place,
                         Eigen::Vector2d* slope, Eigen::Matrix2d* information) const {
  Samples seen;
  float gain = 0;
  for (int k = 0; k < kIterations; ++k) {
    place->warp = warp.facing + warp.depth * slope->transpose();
    if (!Look(smooth, *place, &seen, &gain)) return false;
    const Descent<4> descent = SurfaceDescent(place->warp.inverse(), warp.depth);
    const Samples off = seen / gain - values_;
    const double variance = std::max(kGreyVariance, off.squaredNorm() / static_cast<float>(off.size()));
    Eigen::Matrix4d normal = (descent.transpose() * descent).cast<double>() / variance;
    const Eigen::Matrix4d shown = normal;
    Eigen::Vector4d right = (descent.transpose() * off).cast<double>() / variance;
    normal.bottomRightCorner<2, 2>() += slope_information_;
    right.tail<2>() += slope_information_ * (*slope - slope_);
    const Eigen::Vector4d step = normal.ldlt().solve(right);
    const Eigen::Vector2f move = step.head<2>().cast<float>();
    place->pixel -= move;
    *slope -= step.tail<2>();
    if (!((place->pixel - start).norm() < kMostShift)) return false;
    if (move.norm() > kConverged) continue;
    const Eigen::Matrix2d with_place = shown.topRightCorner<2, 2>();
    *information =
        shown.bottomRightCorner<2, 2>() - with_place.transpose() * shown.topLeftCorner<2, 2>().ldlt().solve(with_place);
    return information->allFinite();
  }
  return false;
}

std::optional<float> Patch::AlignFreely(const cv::Mat& smooth, const Eigen::Vector2f& start, Place* place) const {
  const Descent<6> descent = AffineDescent();
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> normal((descent.transpose() * descent).cast<double>());
  Samples seen;
  float gain = 0;
  for (int k = 0; k < kIterations; ++k) {
    if (!Look(smooth, *place, &seen, &gain)) return {};
    const Eigen::Matrix<double, 6, 1> step =
        normal.solve((descent.transpose() * seen).cast<double>()) / static_cast<double>(gain);
    Eigen::Matrix2d by;
    by << 1 + step(2), step(3), step(4), 1 + step(5);
    if (!(std::abs(by.determinant()) > kLeastDeterminant)) return {};
    place->warp = place->warp * by.inverse();
    const Eigen::Vector2f move = (place->warp * step.head<2>()).cast<float>();
    place->pixel -= move;
    if (!((place->pixel - start).norm() < kMostShift)) return {};
    if (move.norm() > kConverged) continue;
    const float correlation = seen.dot(values_) / std::sqrt(energy_ * seen.squaredNorm());
    return correlation > kLeastCorrelation ? std::optional(correlation) : std::nullopt;
  }
  return {};
}

// Samples less their mean, and how many times stronger than the patch's own they vary. False outside the picture, and
// where it does not show the patch.
bool Patch::Look(const cv::Mat& smooth, const Place& place, Samples* seen, float* gain) const {
  const Eigen::Matrix2f from_grid = step_ * place.warp.cast<float>();
  if (!(std::abs(place.warp.determinant()) > kLeastDeterminant)) return false;
  if (place.bend == nullptr && !HasRoom(smooth, place.pixel, from_grid, kHalf)) return false;
  for (int y = 0, k = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++k) {
      Eigen::Vector2f at = place.pixel + from_grid * Grid(x - kHalf, y - kHalf);
      if (place.bend != nullptr) {
        at += place.bend->col(k);
        if (!IsInside(smooth, at)) return false;
      }
      (*seen)(k) = At(smooth, at);
    }
  }
  seen->array() -= seen->mean();
  *gain = seen->dot(values_) / energy_;
  return *gain > kLeastGain;
}

// How what is seen changes with the place and the slope that it is looked for with: inverse composition (Baker and
// Matthews, Lucas-Kanade 20 years on, 2004).
Patch::Descent<4> Patch::SurfaceDescent(const Eigen::Matrix2d& inverse, const Eigen::Vector2d& depth) const {
  Descent<4> d;
  d.leftCols<2>() = gradient_ * inverse.cast<float>();
  const Samples by_depth = step_ * (gradient_ * (inverse * depth).cast<float>());
  for (int y = 0, k = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++k) d.row(k).tail<2>() = by_depth(k) * Grid(x - kHalf, y - kHalf).transpose();
  }
  ProjectOutGreys(&d);
  return d;
}

Patch::Descent<6> Patch::AffineDescent() const {
  Descent<6> d;
  for (int y = 0, k = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x, ++k) {
      const Eigen::RowVector2f at = step_ * Grid(x - kHalf, y - kHalf).transpose();
      d.row(k) << gradient_.row(k), gradient_(k, 0) * at, gradient_(k, 1) * at;
    }
  }
  ProjectOutGreys(&d);
  return d;
}

// Leaves out what an offset and a gain of grey values would change.
template <int kParameters>
void Patch::ProjectOutGreys(Descent<kParameters>* descent) const {
  for (int c = 0; c < kParameters; ++c) {
    auto column = descent->col(c);
    column.array() -= column.mean();
    column -= values_ * (values_.dot(column) / energy_);
  }
}

}  // namespace trigpoint
