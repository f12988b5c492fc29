// The aerial image as the ground of a drawing of the site from above.
#pragma once

#include <Eigen/Core>
#include <string>

#include "eval/scene/scene_model.h"

namespace trigpoint {

// A JPEG file of the part of `aerial` between two corners (east and north, m, in its frame), north up, `px_per_m`
// pixels a metre; white beyond the image. Toned down to 38 % of its contrast at the bright end, so that lines and words
// stand out: no pixel is darker than 62 % of white.
std::string GroundPicture(const SceneAerial& aerial, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                          double px_per_m);

}  // namespace trigpoint
