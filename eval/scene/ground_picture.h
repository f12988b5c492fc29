// The aerial image as the ground of a drawing of the site from above.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>

#include "eval/scene/scene_model.h"

namespace trigpoint {

// The part of `aerial` between two corners (east and north, m, in its frame), north up, `px_per_m`
// pixels a metre; white beyond the image. Toned down to 38 % of its contrast at the bright end, so that lines and words
// stand out: no pixel is darker than 62 % of white.
cv::Mat GroundImage(const SceneAerial& aerial, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                    double px_per_m);  // 8 bits, BGR
// The same as a JPEG file.
std::string GroundPicture(const SceneAerial& aerial, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                          double px_per_m);

}  // namespace trigpoint
