// Corners of a detected tag to a few hundredths of a pixel, without the detector's shift towards the tag's centre.
//
// The whole printed pattern is known once a tag is decoded. Its picture is predicted as the pattern seen through a
// homography, blurred by a Gaussian of unknown width and by the pixel's own square, encoded by a tone curve of unknown
// exponent, between a dark and a bright level that may each slope across the tag. All of it is fitted to the pixels by
// robust least squares (Gauss-Newton with analytic derivatives), at first to a part of them. Pixels at edges differ
// more from the model than others, so that each of the two kinds has a threshold of its own beyond which it counts
// less.
//
// Where the shift comes from: lens and pixel mix light, the picture holds its 1 / gamma-th power. A pixel that is half
// white is then nearly as bright as a white one, so that the middle of an edge's grey values lies up to 0.2 px on its
// black side and the black square looks smaller from all sides. White cells inside the tag grow by as much as the
// black border shrinks, which tells gamma and geometry apart. Nothing here is a property of a camera or of a data
// set: blur, exponent and noise come from the picture, and so does the covariance of the corners.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <string>

#include "calib/camera/camera.h"
#include "survey/tags/tag_family.h"

namespace trigpoint {

struct CornerRefinement {
  bool ok = false;
  std::string reason;                      // why not, when not ok
  std::array<Eigen::Vector2d, 4> corners;  // our pixels; bottom-left, bottom-right, top-right, top-left
  std::array<double, 4> sigma_px{};        // 1 sigma per axis of each corner
  double blur_px = 0;                      // standard deviation of the Gaussian, beside the pixel's own square
  double gamma = 1;                        // exponent of the tone curve
  double contrast = 0;                     // bright minus dark level, grey values
  double residual = 0;                     // robust standard deviation of picture minus model, grey values
  int iterations = 0;
};

// `grey`: 8-bit, one channel. `corners`: start values within about half a cell, our pixels. `camera`, if given, takes
// care of lens distortion within the tag, else the tag's picture is taken as a homography. Thread safe.
CornerRefinement RefineCorners(const cv::Mat& grey, const TagPattern& pattern,
                               const std::array<Eigen::Vector2d, 4>& corners, const Camera* camera = nullptr);

}  // namespace trigpoint
