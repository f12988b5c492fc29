// The one place where foreign pixel conventions become ours: the centre of the top-left pixel is (0, 0).
#pragma once

#include <Eigen/Core>

namespace trigpoint {

// AprilTag 3 counts from the corner of the first pixel.
inline Eigen::Vector2d FromAprilTagPixel(const Eigen::Vector2d& p) { return p.array() - 0.5; }
// COLMAP counts from the corner of the first pixel: points and principal points alike.
inline Eigen::Vector2d FromColmapPixel(const Eigen::Vector2d& p) { return p.array() - 0.5; }
inline Eigen::Vector2d ToColmapPixel(const Eigen::Vector2d& p) { return p.array() + 0.5; }
// OpenCV 4.6's SIFT draws its keypoints a quarter of a pixel to the right and down, at all scales
// (an effect of how it doubles the first octave).
inline Eigen::Vector2d FromOpenCvSiftPixel(const Eigen::Vector2d& p) { return p.array() - 0.25; }

}  // namespace trigpoint
