// Projection by bare parameters, with derivatives by them: for optimisers, which move parameters.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/camera/camera.h"

namespace trigpoint {

// The names of a model's parameters in their order ("fx", "fy", ...); `count` tells radtan with k3 from radtan without.
std::vector<std::string> CameraParameterNames(CameraModel model, size_t count);

// Pixel of a point in the camera frame, without a check of where the mapping is valid (Camera::Project has it). False
// only where there is no projection at all (behind a perspective camera). Jacobians, if given: d pixel / d point, and
// d pixel / d params (2 x count). Not for equirectangular.
bool ProjectByParams(CameraModel model, const std::vector<double>& params, const Eigen::Vector3d& point,
                     Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* by_point = nullptr,
                     Eigen::Matrix<double, 2, Eigen::Dynamic>* by_params = nullptr);

}  // namespace trigpoint
