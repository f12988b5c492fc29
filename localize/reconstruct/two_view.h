// Verification of matches between two images by their geometry.
#pragma once

#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

// Of a pair that counts as verified: five determine a relative pose, the others show whether it holds and how much they
// scatter about it.
constexpr int kLeastMatches = 12;

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

// The relative pose of two images that need not be neighbours, from their matches alone.
struct WideBaselineOptions {
  double inlier_rad = 0.0015;  // largest angle of a ray from its epipolar plane
  double span_rad = 1.0;       // field of view over which a wrong match scatters, rad
  // Of the prior: [rotation (rad, left), direction of translation (rad, along the rows of TangentBasis)].
  Eigen::Matrix<double, 5, 5> prior_covariance = 100 * Eigen::Matrix<double, 5, 5>::Identity();
  double max_false_alarms = 1e-3;  // expected number of models this good among random matches (Moisan & Stival 2004)
  int ransac_iterations = 3000;
  uint64_t seed = 1;
};

struct WideBaselineResult {
  bool verified = false;
  Rigid3d b_from_a;               // unit translation; its direction means nothing if `rotation_only`
  bool rotation_only = false;     // a rotation explains the matches as well as an essential matrix does
  double log10_false_alarms = 0;  // of the model, base 10
  std::vector<int> inliers;       // indices into the matches, in front of both views
  // Of [rotation (rad, left), direction of translation (rad, along the rows of TangentBasis)], from the inliers with
  // the noise that they show.
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Zero();
};

// The matches whose rays meet within `inlier_rad` of an epipolar plane and in front of both views.
std::vector<int> EpipolarInliers(const std::vector<Eigen::Vector3d>& rays_a, const std::vector<Eigen::Vector3d>& rays_b,
                                 const Rigid3d& b_from_a, double inlier_rad);

// The most likely pose by matches and prior; where less than half of the matches agree with the prior, five-point
// RANSAC looks for others. Verified where so many inliers are not expected by chance.
WideBaselineResult VerifyWideBaseline(const std::vector<Eigen::Vector3d>& rays_a,
                                      const std::vector<Eigen::Vector3d>& rays_b, const Rigid3d& prior_b_from_a,
                                      const WideBaselineOptions& options);

// The relative pose that explains most matches, whatever a prior would say: the best of what five-point RANSAC and
// refinement find from several starts.
struct RelativePoseEstimate {
  WideBaselineResult best;
  bool rotation_ambiguous = false;   // another pose with another rotation explains nearly as many
  bool direction_ambiguous = false;  // or with another direction of translation
};
RelativePoseEstimate EstimateRelativePose(const std::vector<Eigen::Vector3d>& rays_a,
                                          const std::vector<Eigen::Vector3d>& rays_b,
                                          const WideBaselineOptions& options);

// The paper's verification: inliers of a homography (RANSAC), as indices into the matches. `homography`: b from a.
std::vector<int> VerifyHomography(const std::vector<Eigen::Vector2f>& a, const std::vector<Eigen::Vector2f>& b,
                                  double threshold_px, Eigen::Matrix3d* homography = nullptr);

}  // namespace trigpoint
