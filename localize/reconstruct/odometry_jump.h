// Does odometry jump along the direction of motion? Directions of motion, which pairs of images show, cannot tell.
#pragma once

#include <optional>

#include "datasets/solution/reconstruction.h"
#include "localize/reconstruct/frames.h"

namespace trigpoint {

// Two moments that follow each other, with images on both sides that show the same points.
struct JumpByPoints {
  int before = 0, after = 0;                          // body poses
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();  // by which what follows is to be moved, odometry's axes
  int points = 0;                                     // seen on both sides, and known by one of them alone
  int fitting = 0, fitting_unmoved = 0;               // of these, with the shift and without
};

// Looks at the moments across which most points were left out of the solution. Points that the images of one side
// place by themselves are compared with what the other side sees: a shift of all that follows is found by RANSAC.
// Nothing unless it explains most of the points, many times more than no shift does, and makes the run's speed more
// even.
std::optional<JumpByPoints> FindJumpByPoints(const LocalizeInput& input, const Reconstruction& reconstruction,
                                             uint64_t seed);

}  // namespace trigpoint
