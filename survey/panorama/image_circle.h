// The bright circle that a fisheye lens draws on a frame larger than its picture.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

namespace trigpoint {

// Pixels: the centre of the top-left pixel is (0, 0). The circle may run past the frame. Without the unsharp rim.
struct ImageCircle {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_px = 0;
};

// The circle of an 8-bit grey photo whose four corners are black, if the border between black and picture is one;
// nothing otherwise: pictures that fill their frame, and dark corners of any other shape.
std::optional<ImageCircle> FindImageCircle(const cv::Mat& grey);

}  // namespace trigpoint
