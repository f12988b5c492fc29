// Verification of matches between two images by their geometry.
#pragma once

#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "localize/matching.h"

namespace trigpoint {

struct TwoViewOptions {
  double inlier_rad = 0.004;         // largest angle of a ray from its epipolar plane
  double sigma_rotation_rad = 0.02;  // how far the prior's rotation may be off, 1 sigma
  double sigma_direction_rad = 0.1;  // how far the prior's direction of motion may be off, 1 sigma
  double min_prior_inliers = 0.5;    // share of matches that must agree with the refined prior; else RANSAC
  int ransac_iterations = 400;
  uint64_t seed = 1;
};

struct TwoViewResult {
  Rigid3d b_from_a;          // length of the translation as in the prior
  std::vector<int> inliers;  // indices into the matches
  bool used_ransac = false;
};

// Refines a prior relative pose on matched rays (robust, with the prior as a factor) and says which matches agree; a
// five-point RANSAC takes over where the prior does not explain the matches.
TwoViewResult VerifyTwoView(const std::vector<Eigen::Vector3d>& rays_a, const std::vector<Eigen::Vector3d>& rays_b,
                            const Rigid3d& prior_b_from_a, const TwoViewOptions& options);

// The paper's verification: inliers of a homography (RANSAC), as indices into the matches. `homography`: b from a.
std::vector<int> VerifyHomography(const std::vector<Eigen::Vector2f>& a, const std::vector<Eigen::Vector2f>& b,
                                  double threshold_px, Eigen::Matrix3d* homography = nullptr);

}  // namespace trigpoint
