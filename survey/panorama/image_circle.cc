#include "survey/panorama/image_circle.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calib/base/median.h"
#include "calib/camera/shrunk_picture.h"

namespace trigpoint {
namespace {

constexpr int kLongSide = 600;  // px; the border of a circle is soft, more would show nothing
constexpr int kRays = 360;
// Black is what is darker than this share of the picture's bright parts.
constexpr double kBlack = 0.15;
constexpr double kStray = 0.4;
// The border lies on one circle to this share of its radius, over this share of the rays that meet it.
constexpr double kOnCircle = 0.015, kLeastShare = 0.5;
constexpr int kLeastPoints = 60;
constexpr double kSharpShare = 0.985;  // of the radius; the rim is unsharp and coloured

// x^2 + y^2 = 2 a x + 2 b y + c, least squares.
ImageCircle FitCircle(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector3d row(2 * p.x(), 2 * p.y(), 1);
    h += row * row.transpose();
    g += row * p.squaredNorm();
  }
  const Eigen::Vector3d x = h.ldlt().solve(g);
  return {x.head<2>(), std::sqrt(std::max(0.0, x(2) + x.head<2>().squaredNorm()))};
}

// What is darker is black.
double BlackLevel(const cv::Mat& picture) {
  std::vector<uchar> values(picture.begin<uchar>(), picture.end<uchar>());
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() * 3 / 4), values.end());
  return kBlack * values[values.size() * 3 / 4];
}

bool HasBlackCorners(const cv::Mat& picture, double black) {
  const int patch = std::max(2, kLongSide / 40);
  if (picture.cols < 4 * patch || picture.rows < 4 * patch) return false;
  for (const int x : {0, picture.cols - patch}) {
    for (const int y : {0, picture.rows - patch}) {
      if (cv::mean(picture(cv::Rect(x, y, patch, patch)))[0] > black) return false;
    }
  }
  return true;
}

Eigen::Vector2d MiddleOf(const cv::Mat& picture) { return {0.5 * (picture.cols - 1), 0.5 * (picture.rows - 1)}; }

// From outside inwards: what is dark in the picture itself is not met. Rays that begin in the picture say nothing.
std::vector<Eigen::Vector2d> BorderPoints(const cv::Mat& picture, double black) {
  const Eigen::Vector2d middle = MiddleOf(picture);
  std::vector<Eigen::Vector2d> border;
  for (int k = 0; k < kRays; ++k) {
    const double angle = 2 * std::numbers::pi * k / kRays;
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    const double reach =
        std::min(middle.x() / std::max(1e-9, std::abs(along.x())), middle.y() / std::max(1e-9, std::abs(along.y())));
    const auto value = [&](double r) {
      const Eigen::Vector2d p = middle + r * along;
      return picture.at<uchar>(static_cast<int>(std::lround(p.y())), static_cast<int>(std::lround(p.x())));
    };
    double r = std::floor(reach);
    if (value(r) > black) continue;
    // Stray light around the circle is dim beside what lies in it on the same side.
    std::vector<uchar> lit;
    for (double at = 0; at < reach; at += 1) {
      if (value(at) > black) lit.push_back(value(at));
    }
    if (lit.empty()) continue;
    const double limit = std::max(black, kStray * Median(std::move(lit)));
    while (r > 0 && value(r) <= limit) r -= 0.5;
    if (r > 0) border.emplace_back(middle + r * along);
  }
  return border;
}

std::vector<Eigen::Vector2d> PointsOn(const ImageCircle& c, const std::vector<Eigen::Vector2d>& border) {
  std::vector<Eigen::Vector2d> on;
  for (const Eigen::Vector2d& p : border) {
    if (std::abs((p - c.centre).norm() - c.radius_px) < kOnCircle * c.radius_px) on.push_back(p);
  }
  return on;
}

// Dark trees at the border pull points inwards, stray light outwards: the circle that most lie on, of those through
// three points far from each other.
ImageCircle MostCommonCircle(const std::vector<Eigen::Vector2d>& border) {
  ImageCircle circle;
  std::vector<Eigen::Vector2d> used;
  const size_t n = border.size();
  for (size_t i = 0; i < n; i += 3) {
    for (size_t j = n / 5; j <= n / 2; j += std::max<size_t>(1, n / 20)) {
      const ImageCircle c = FitCircle({border[i], border[(i + j) % n], border[(i + 2 * j) % n]});
      std::vector<Eigen::Vector2d> on = PointsOn(c, border);
      if (on.size() > used.size()) circle = c, used = std::move(on);
    }
  }
  for (int round = 0; round < 5 && used.size() >= 3; ++round) {
    circle = FitCircle(used);
    used = PointsOn(circle, border);
  }
  return circle;
}

// Enough of the border lies on it, and all around.
bool IsBorder(const ImageCircle& circle, const std::vector<Eigen::Vector2d>& border) {
  int on = 0;
  bool quarter[4] = {};
  for (const Eigen::Vector2d& p : border) {
    const Eigen::Vector2d d = p - circle.centre;
    if (std::abs(d.norm() - circle.radius_px) > kOnCircle * circle.radius_px) continue;
    ++on;
    quarter[(d.x() > 0 ? 1 : 0) + (d.y() > 0 ? 2 : 0)] = true;
  }
  if (on < kLeastPoints || on < kLeastShare * static_cast<double>(border.size())) return false;
  return quarter[0] && quarter[1] && quarter[2] && quarter[3];
}

}  // namespace

std::optional<ImageCircle> FindImageCircle(const cv::Mat& grey) {
  const ShrunkPicture shrunk(grey, kLongSide);
  cv::Mat small;
  cv::GaussianBlur(shrunk.picture, small, cv::Size(), 1.5);
  const double black = BlackLevel(small);
  if (!HasBlackCorners(small, black)) return std::nullopt;
  const std::vector<Eigen::Vector2d> border = BorderPoints(small, black);
  if (static_cast<int>(border.size()) < kLeastPoints) return std::nullopt;
  const ImageCircle circle = MostCommonCircle(border);
  if (!IsBorder(circle, border)) return std::nullopt;
  const double side = std::max(small.cols, small.rows);
  if (circle.radius_px < 0.2 * side || circle.radius_px > 0.7 * side) return std::nullopt;
  if ((circle.centre - MiddleOf(small)).norm() > 0.15 * side) return std::nullopt;
  return ImageCircle{shrunk.ToFull(circle.centre), kSharpShare * circle.radius_px * shrunk.full_per_pixel.x()};
}

}  // namespace trigpoint
