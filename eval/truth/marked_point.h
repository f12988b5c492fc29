// Where a point that is marked in two images must lie in the others.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "datasets/project/project.h"

namespace trigpoint {

struct PredictedMark {
  std::string run, file, image;  // file as in images.txt, image below the project
  Eigen::Vector2d pixel;
  Eigen::Matrix2d covariance_px2;  // of the predicted pixel: of the marks, through the point
  std::optional<Eigen::Vector2d> marked;
};

struct PointSolution {
  Eigen::Vector3d world_m;     // site ENU
  Eigen::Matrix3d covariance;  // m^2, 1 px marks, cameras held
  double rms_px = 0;           // of the marks; from two marks it says little
  int marks = 0;
  std::vector<PredictedMark> images;  // every image that must show it, nearest camera first
};

// From the marks in localized images, by least squares on their pixels. Throws InputError if fewer than two marks lie
// in localized images, NumericError if their rays don't meet.
PointSolution PredictPoint(const Project& project, const std::string& point, const std::string& variant);

}  // namespace trigpoint
