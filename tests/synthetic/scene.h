// Scenes of textured parallelograms and their pictures through any camera model: a ray caster with mipmaps and
// supersampling, so that a feature looks the same from near and far.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

// A BGR picture with its mipmaps. Immutable; shared between planes and threads.
class Texture {
 public:
  explicit Texture(const cv::Mat& bgr);
  int width() const { return levels_.front().cols; }
  int height() const { return levels_.front().rows; }
  // Colour at texel (u, v) of level 0 (centre of the first texel: 0, 0), averaged over about `footprint` texels
  // (trilinear). Clamped to the border.
  cv::Vec3f Sample(float u, float v, float footprint) const;

 private:
  std::vector<cv::Mat> levels_;
};

// The picture's top-left corner, its top edge and its left edge in the world, metres: a texture point (s, t) in
// [0, 1]^2 is at corner + s * right + t * down. Seen from both sides.
struct TexturedPlane {
  Eigen::Vector3d corner, right, down;
  std::shared_ptr<const Texture> texture;
};

struct Scene {
  std::vector<TexturedPlane> planes;
  Eigen::Vector3d sun = Eigen::Vector3d(0.4, -0.6, 0.7);  // towards it; shades planes by their normal
  double ambient = 0.6;                                   // share of the light that comes from everywhere
  cv::Vec3f sky_low = {235, 225, 215}, sky_high = {220, 170, 120};
};

struct RenderOptions {
  int supersample = 2;       // rays per pixel edge
  double gain = 1;           // exposure
  double blur_sigma_px = 0;  // defocus, after rendering
  double noise_sigma = 0;    // of the sensor, grey values
  uint64_t seed = 1;         // of that noise
  int threads = 1;           // 0: all cores; the picture does not depend on it
};

// The scene as `camera` sees it, BGR 8 bit. Pixels without a ray are black. Throws OptionError for supersample < 1.
cv::Mat Render(const Scene& scene, const Camera& camera, const Rigid3d& world_from_cam, const RenderOptions& options);

// Index of the plane first hit by a ray and the distance along it (unit `direction`); -1 if none. For visibility.
int FirstHit(const Scene& scene, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double* distance);

}  // namespace trigpoint
