#include "eval/scene/ground_picture.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace trigpoint {

cv::Mat GroundImage(const SceneAerial& aerial, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                    double px_per_m) {
  constexpr double kContrast = 0.38;
  const auto at = [&](int r, int c) {
    const Eigen::Vector3d& p = aerial.vertices[static_cast<size_t>(r * aerial.columns + c)];
    return cv::Point2f(static_cast<float>(px_per_m * (p.x() - low_m.x())),
                       static_cast<float>(px_per_m * (high_m.y() - p.y())));
  };
  const auto w = static_cast<float>(aerial.picture.cols), h = static_cast<float>(aerial.picture.rows);
  const cv::Point2f from[] = {{0, 0}, {w, 0}, {w, h}, {0, h}};
  const cv::Point2f to[] = {at(0, 0), at(0, aerial.columns - 1), at(aerial.rows - 1, aerial.columns - 1),
                            at(aerial.rows - 1, 0)};
  const Eigen::Vector2d size = px_per_m * (high_m - low_m);
  cv::Mat ground;
  cv::warpPerspective(aerial.picture, ground, cv::getPerspectiveTransform(from, to),
                      {std::max(1, static_cast<int>(size.x())), std::max(1, static_cast<int>(size.y()))},
                      cv::INTER_AREA, cv::BORDER_CONSTANT, {255, 255, 255});
  ground.convertTo(ground, -1, kContrast, 255 * (1 - kContrast));
  return ground;
}

std::string GroundPicture(const SceneAerial& aerial, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                          double px_per_m) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", GroundImage(aerial, low_m, high_m, px_per_m), bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return {bytes.begin(), bytes.end()};
}

}  // namespace trigpoint
