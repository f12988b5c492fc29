// How sharp and how well exposed a picture is, from the picture alone.
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace trigpoint {

// Blur: standard deviation of a Gaussian that makes an ideal edge as wide as those of the picture, pixels of the
// picture at a longer side of kQualitySide_px (smaller pictures as they are): from the ratio of the gradients before
// and after a known blur (Zhuo & Sim, "Defocus map estimation from a single image", 2011, equation 4), corrected for
// the difference over two pixels and for edges between pixels. Motion widens the edges across it alone, so the larger
// one of the medians over upright and over level edges counts. The variance of sampling itself is included, 5/12 px^2:
// an edge with a blur of 0.2 px or less has 0.68 px, fine texture less.
constexpr int kQualitySide_px = 1280;
constexpr int kQualityCells = 3;  // rows and columns of `cell_blur_px`
struct PictureQuality {
  double mean = 0;                // grey values
  double dark = 0, bright = 0;    // shares of pixels that are nearly black (8 or less), nearly white (250 or more)
  std::optional<double> blur_px;  // none: too few edges
  // Of the parts of the picture, row by row.
  std::array<std::optional<double>, kQualityCells * kQualityCells> cell_blur_px;
};

// `grey`: 8-bit, one channel. `mask`: of its size, 0 where the picture is left out of every number; empty: nowhere.
// Thread safe.
PictureQuality MeasurePicture(const cv::Mat& grey, const cv::Mat& mask = {});

}  // namespace trigpoint
