// Where a feature of one photo lies in another, told by its surroundings: least-squares matching of patches (Gruen
// 1985). A detector places the same thing in two photos a third of a pixel apart, patches a tenth; and they say how
// well they know it in which direction, which is what an edge lacks.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/camera/shrunk_picture.h"

namespace trigpoint {

// A photo's picture as patches are taken from it: halved again and again.
class PatchImage {
 public:
  PatchImage() = default;
  explicit PatchImage(const ShrunkPicture& grey);  // 8 bits

  bool empty() const { return levels_.empty(); }
  int levels() const { return static_cast<int>(levels_.size()); }
  const cv::Mat& level(int l) const { return levels_[static_cast<size_t>(l)]; }
  // Pixels of the full picture in one of the level, along x and y; and where a pixel of it lies in the level.
  Eigen::Array2d FullPerLevel(int l) const { return full_per_small_ * static_cast<double>(1 << l); }
  Eigen::Vector2d ToLevel(const Eigen::Vector2d& pixel, int l) const;
  Eigen::Vector2d FromLevel(const Eigen::Vector2d& at, int l) const;

 private:
  std::vector<cv::Mat> levels_;
  Eigen::Array2d full_per_small_ = Eigen::Array2d::Ones();
};

struct PatchAlignment {
  Eigen::Vector2d pixel;  // of b's full picture
  Eigen::Matrix2d
      covariance;  // of it, px^2, up to a factor that all patches share (noise of neighbouring pixels is alike)
};

// What lies at `pixel_a` of a, looked for about `pixel_b` of b, which is known to `sigma` px of the level of the
// feature's scale (below): it counts as a measurement. `b_from_a`: how far b's pixel moves with a's (2 x 2).
// `scale_px`: of the feature, px of a's full picture. Nothing: the patches leave the picture, or do not look alike.
std::optional<PatchAlignment> AlignPatch(const PatchImage& a, const Eigen::Vector2d& pixel_a, const PatchImage& b,
                                         const Eigen::Vector2d& pixel_b, const Eigen::Matrix2d& b_from_a,
                                         double scale_px, double sigma);

}  // namespace trigpoint
