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

// One step of odometry that images contradict, while they agree with all others.
struct ContradictedStep {
  int before = 0, after = 0;                          // body poses
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();  // of what follows, by the images, odometry's axes
  double gain = 0;                                    // in chi-square if the step is not believed
  bool of_images = false;  // the images' step stands out, as where pictures are missing, not odometry's
};

// Looks at runs whose features' noise was widened, as odometry contradicts the images, beyond what correlation along
// tracks explains: each step, or of many those that fit worst, is left out by itself. Nothing unless one of them alone
// explains the contradiction, and the images' step makes the run's speed more even (as FindJumpByPoints), or odometry's
// is even as it is and the images' is longer. Throws NumericError if the data do not determine the poses.
std::optional<ContradictedStep> FindContradictedStep(const LocalizeInput& input, const Reconstruction& reconstruction,
                                                     int threads, const CancelToken& cancel);

}  // namespace trigpoint
