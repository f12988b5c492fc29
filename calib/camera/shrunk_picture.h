// A photo's picture made smaller, and where its pixels lie in the full one. Pixels: the centre of the top-left pixel is
// (0, 0); the picture's edges stay its edges.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace trigpoint {

// A picture's mask where the picture is reduced to `size`; an empty one stays so.
inline cv::Mat ReducedMask(const cv::Mat& mask, const cv::Size& size) {
  if (mask.empty() || mask.size() == size) return mask;
  cv::Mat reduced;
  cv::resize(mask, reduced, size, 0, 0, cv::INTER_NEAREST);
  return reduced;
}

struct ShrunkPicture {
  // At most `long_side` px; a picture that is no longer than that is shared, not copied.
  ShrunkPicture(const cv::Mat& full, int long_side) : picture(full) {
    const double factor = static_cast<double>(long_side) / std::max(full.cols, full.rows);
    if (!(factor < 1)) return;
    picture.release();
    // To a size, not by a factor: by a factor OpenCV rounds the size and not the scale, so that the lower edge of a
    // picture whose height the factor does not make whole would lie up to half a small pixel off.
    const auto side = [&](int pixels) { return std::max(1, static_cast<int>(std::lround(pixels * factor))); };
    cv::resize(full, picture, cv::Size(side(full.cols), side(full.rows)), 0, 0, cv::INTER_AREA);
    full_per_pixel = {static_cast<double>(full.cols) / picture.cols, static_cast<double>(full.rows) / picture.rows};
  }
  Eigen::Vector2d ToFull(const Eigen::Vector2d& p) const { return (p.array() + 0.5) * full_per_pixel - 0.5; }
  Eigen::Vector2d FromFull(const Eigen::Vector2d& p) const { return (p.array() + 0.5) / full_per_pixel - 0.5; }

  cv::Mat picture;
  Eigen::Array2d full_per_pixel = Eigen::Array2d::Ones();  // along x and y
};

}  // namespace trigpoint
