// Pictures of tags with exactly known corners: the pattern seen by a camera, averaged over each pixel, blurred in
// light, encoded by a tone curve, with noise. Written for tests; shares nothing with the code under test but the
// printed pattern.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/camera/camera.h"
#include "calib/estimation/random.h"
#include "calib/geometry/rigid3.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {

struct TagPicture {
  double size_m = 0.5;
  double blur_px = 0.7;                                 // Gaussian, in light
  double gamma = 2.2;                                   // grey = light^(1 / gamma)
  double dark = 0.02, bright = 0.8, background = 0.15;  // light
  double noise = 1.5;                                   // grey values
  uint64_t seed = 1;
  int supersample = 6;
};

inline cv::Mat RenderTag(const TagPattern& pattern, const Camera& camera, const Rigid3d& cam_from_tag,
                         const TagPicture& options) {
  const int n = options.supersample;
  cv::Mat light(camera.height(), camera.width(), CV_32F, cv::Scalar(options.background));
  const Rigid3d tag_from_cam = cam_from_tag.Inverse();
  const double cell = options.size_m / pattern.width;
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);  // where the sheet is
  for (int k = 0; k < 4; ++k) {
    const double h = 0.5 * cell * pattern.total;
    const auto p = camera.Project(cam_from_tag * Eigen::Vector3d(k % 2 ? h : -h, k < 2 ? h : -h, 0));
    if (p) low = low.cwiseMin(*p), high = high.cwiseMax(*p);
  }
  const double pad = 1 + 0.05 * (high - low).maxCoeff();  // its edges may bend under distortion
  for (int v = std::max(0, int(low.y() - pad)); v <= std::min(camera.height() - 1, int(high.y() + pad)); ++v) {
    for (int u = std::max(0, int(low.x() - pad)); u <= std::min(camera.width() - 1, int(high.x() + pad)); ++u) {
      double sum = 0;
      for (int i = 0; i < n * n; ++i) {
        const Eigen::Vector2d p(u + (i % n + 0.5) / n - 0.5, v + (i / n + 0.5) / n - 0.5);
        double value = options.background;
        if (const auto ray = camera.Unproject(p)) {
          const Eigen::Vector3d d = tag_from_cam.rotation * *ray, o = tag_from_cam.translation;
          const double s = -o.z() / d.z();
          const Eigen::Vector3d q = o + s * d;
          const int column = static_cast<int>(std::floor((q.x() + 0.5 * options.size_m) / cell)) + pattern.margin;
          const int row = static_cast<int>(std::floor((q.y() + 0.5 * options.size_m) / cell)) + pattern.margin;
          if (s > 0 && row >= 0 && column >= 0 && row < pattern.total && column < pattern.total) {
            value = pattern.At(row, column) ? options.bright : options.dark;
          }
        }
        sum += value;
      }
      light.at<float>(v, u) = static_cast<float>(sum / (n * n));
    }
  }
  if (options.blur_px > 0) cv::GaussianBlur(light, light, cv::Size(), options.blur_px);
  Random random(options.seed);
  cv::Mat grey(light.size(), CV_8U);
  for (int v = 0; v < grey.rows; ++v) {
    for (int u = 0; u < grey.cols; ++u) {
      const double encoded = 255 * std::pow(light.at<float>(v, u), 1 / options.gamma);
      grey.at<unsigned char>(v, u) =
          cv::saturate_cast<unsigned char>(std::lround(encoded + options.noise * random.Normal()));
    }
  }
  return grey;
}

}  // namespace trigpoint
