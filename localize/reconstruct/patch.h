// A small picture about a feature, which finds itself in other pictures to some hundredths of a pixel.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace trigpoint {

// Grey values as patches sample them: 32-bit, slightly smoothed.
cv::Mat SmoothForPatches(const cv::Mat& grey);

// How a piece of a surface that was cut out of one picture appears in another: what is p px from its middle there is
// facing * p away here if the surface faces that camera, and depth * d farther if it is d metres farther from it.
struct SurfaceWarp {
  Eigen::Matrix2d facing;
  Eigen::Vector2d depth;  // px/m
};

// A plane through the middle of a patch.
struct ExpectedPlane {
  Eigen::Vector2d slope;  // depth, m, a px of the patch's picture
  // Takes how far a spot of the plane is from the patch's middle in the patch's picture, gives how far it is from there
  // in the other picture, px. Not finite where the other picture does not show it.
  std::function<Eigen::Vector2d(const Eigen::Vector2d& px)> shown;
};

// Of the patch about a feature of this scale, px.
double PatchRadius(float scale);

class Patch {
 public:
  // The picture within about `radius_px` of a pixel; depth_per_px: the size of a pixel at the surface, m. False where
  // the picture ends or shows nothing.
  bool Cut(const cv::Mat& smooth, const Eigen::Vector2f& pixel, double radius_px, double depth_per_px);

  // `pixel`: about where the patch's middle is in another picture, and where it is once aligned. Returns how the two
  // pictures correlate; nothing, and nothing changed, where the other one shows something else. What it shows of the
  // surface's slope serves the next picture.
  std::optional<float> Align(const cv::Mat& smooth, const SurfaceWarp& warp, Eigen::Vector2f* pixel);
  // The same for a surface that is expected to be this plane, of which the patch keeps the slope. Where the plane is
  // seen edge on it appears bent, against which a warp that is linear does not help.
  std::optional<float> AlignPlane(const cv::Mat& smooth, const SurfaceWarp& warp, const ExpectedPlane& plane,
                                  Eigen::Vector2f* pixel);

 private:
  static constexpr int kHalf = 6;  // samples on each side of the middle
  static constexpr int kSide = 2 * kHalf + 1;
  using Samples = Eigen::Matrix<float, kSide * kSide, 1>;
  template <int kParameters>
  using Descent = Eigen::Matrix<float, kSide * kSide, kParameters>;
  using Bend = Eigen::Matrix<float, 2, kSide * kSide>;  // of each sample beyond a linear warp, px
  struct Place {
    Eigen::Matrix2d warp;  // pixels of a picture to a pixel of the patch's own
    Eigen::Vector2f pixel;
    const Bend* bend = nullptr;  // none: the warp is linear
  };

  std::optional<float> AlignAt(const cv::Mat& smooth, const SurfaceWarp& warp, const Bend* bend,
                               Eigen::Vector2f* pixel);
  bool AlignSurface(const cv::Mat& smooth, const SurfaceWarp& warp, const Eigen::Vector2f& start, Place* place,
                    Eigen::Vector2d* slope, Eigen::Matrix2d* information) const;
  std::optional<float> AlignFreely(const cv::Mat& smooth, const Eigen::Vector2f& start, Place* place) const;
  bool Look(const cv::Mat& smooth, const Place& place, Samples* seen, float* gain) const;
  Descent<4> SurfaceDescent(const Eigen::Matrix2d& inverse, const Eigen::Vector2d& depth) const;
  Descent<6> AffineDescent() const;
  template <int kParameters>
  void ProjectOutGreys(Descent<kParameters>* descent) const;

  float step_ = 1;  // px, between samples
  Samples values_;  // less their mean
  Eigen::Matrix<float, kSide * kSide, 2> gradient_;
  float energy_ = 0;
  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();  // of the surface: depth, m, a px
  Eigen::Matrix2d slope_information_ = Eigen::Matrix2d::Identity();
};

}  // namespace trigpoint
