// Points of a run's sparse model with how well they are known.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "eval/scene/scene_model.h"

namespace trigpoint {

// Every point of the model in `sparse`, in the model's own frame, with ScenePoint::run = `run`. sigma_m: largest
// standard deviation of the position with the cameras held: sum over its rays of (I - d d') / (sigma_ray depth)^2,
// sigma_ray from the median residual of the model. Names of the model's images are added to `images`, into which
// ScenePoint::image counts. Throws InputError naming the file.
std::vector<ScenePoint> ReadScenePoints(const std::filesystem::path& sparse, int run, std::vector<std::string>* images);

}  // namespace trigpoint
