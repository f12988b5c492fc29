// How sharp and how well exposed a picture is, from the picture alone.
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace trigpoint {

// Blur: standard deviation of a Gaussian that makes an ideal edge as wide as those of the picture, pixels of the
// picture at a longer side of kQualitySide_px (smaller pictures as they are): from the ratio of the gradients before
// and after a known blur (Zhuo & Sim, "Defocus map estimation from a single image", 2011, equation 4), corrected for
// the difference over two pixels and for edges between pixels. Motion widens the edges across it alone, so the larger
// one of the medians over upright and over level edges counts. The variance of sampling itself is included, 5/12 px^2:
// an edge with a blur of 0.2 px or less has 0.68 px, fine texture less.
constexpr int kQualitySide_px = 1280;
constexpr int kQualityCells = 3;  // rows and columns of `cell_blur_px`

// Mean squared gradient, (grey values a pixel)^2, of square cells: of the picture, and of the picture blurred by
// kReblur_px. It has a value where there are no edges, and adds up over pictures: for an edge its ratio is
// sqrt(1 + (kReblur_px / blur)^2), with the blur as it is defined below.
constexpr double kReblur_px = 1;
constexpr int kEnergyColumns = 16;  // a disc of 2 sqrt(2) / 16 = 18 % of the width covers a cell wherever it is
struct GradientEnergy {
  int rows = 0;
  std::vector<float> sharp, reblurred;  // row by row; 0: the cell is masked or without texture
};

struct PictureQuality {
  double mean = 0;                // grey values
  double dark = 0, bright = 0;    // shares of pixels that are nearly black (8 or less), nearly white (250 or more)
  std::optional<double> blur_px;  // none: too few edges
  // Of the parts of the picture, row by row.
  std::array<std::optional<double>, kQualityCells * kQualityCells> cell_blur_px;
  GradientEnergy energy;
};

// `grey`: 8-bit, one channel. `mask`: of its size, 0 where the picture is left out of every number; empty: nowhere.
// Thread safe.
PictureQuality MeasurePicture(const cv::Mat& grey, const cv::Mat& mask = {});

}  // namespace trigpoint
