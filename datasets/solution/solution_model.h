// A solution as a sparse model, for COLMAP and everybody who reads its files.
#pragma once

#include <vector>

#include "datasets/colmap/model.h"
#include "datasets/solution/solution.h"

namespace trigpoint {

struct SolutionModel {
  SparseModel model;                         // frame odom; ids of images, cameras and points are indices + 1
  std::vector<std::vector<int>> feature_of;  // of each image's pixels: in features.db
};

// Images of the run with what they see of the points that are part of the solution and have two rays or more.
SolutionModel ModelOf(const Solution& solution);

}  // namespace trigpoint
