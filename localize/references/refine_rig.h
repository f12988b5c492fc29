// A photo set's rig against points whose place is known: from a localized run, in metres. What the photos alone leave
// open - how large the rig is - the distances show.
//
// Minimises, over the rig's pose, its scale s, each photo's turn w_i and shift e_i (before scaling), and the points,
//   sum rho(|predicted px - observed px|^2 / sigma^2) + |point - known|^2 in the metric of its covariance
//   + |[w; e]|^2 in the metric of the stitched rig's covariance + (ln s / sigma_ln_s)^2
// with  cam_i_from_rig: R_i' = Exp(w_i) R_i,  centre c_i' = s (c_i + e_i).
//   fixed: w = e = 0, s = 1.  scaled: w = e = 0.  prior: as above.  free: each photo's centre by itself, within
//   `free_sigma_m`.
// A point that several photos see is off for all of them alike: between them its parallax shows the rig's size however
// badly its place across the rays is known. Points without covariance are held. Gauge: none is free, the points give
// all six.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "calib/camera/rig.h"

namespace trigpoint {

// A point seen by a photo.
struct KnownPoint {
  int view = 0;
  Eigen::Vector2d pixel;
  Eigen::Vector3d point;                                 // world (the run's frame), m; photos that see it say the same
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of the point, m^2
};

enum class RigFreedom { kFixed, kScaled, kPrior, kFree };
std::string RigFreedomName(RigFreedom freedom);

struct RefineRigInput {
  ViewRig rig;  // rig_from_view as stitched
  // Of all views' [turn of cam_from_rig (left, rad), centre about the mean of the centres (m)] at the rig's size.
  Eigen::MatrixXd shape_covariance;
  double log_scale_sigma = 0.7;
  Rigid3d rig_from_world;  // start
  std::vector<KnownPoint> points;
  double sigma_px = 1;
  double free_sigma_m = 0.5;
};

struct RefinedRig {
  Rigid3d rig_from_world;
  ViewRig rig;       // origin: the mean of the centres again; covariances relative to it
  double scale = 1;  // against the input
  double scale_sigma = 0;
  Matrix6d covariance = Matrix6d::Zero();  // of rig_from_world, with that origin
  // Of all rig_from_view of `rig` jointly (left tangents, 6 rows and columns a view): its shape and its size. Empty for
  // a fixed rig, and where the points do not determine the pose.
  Eigen::MatrixXd view_covariance;
  double rms_px = 0;  // of the observations that count
  int used = 0;
};

// The covariances of a scaled rig contain what its stitched shape leaves open; those of a fixed one do not.
RefinedRig RefineRig(const RefineRigInput& input, RigFreedom freedom);

// As RefinedRig::view_covariance of the rig as stitched, before any point is known. The input needs no points.
Eigen::MatrixXd StitchedViewCovariance(const RefineRigInput& input);

// The freedom that predicts best; a freer one must be better than a stricter one by more than chance (two standard
// errors of the mean gain over photos). `errors`: the median reprojection errors (px) of points that took no part (five
// folds of whole points), in order of freedom.
RigFreedom ChooseFreedom(const RefineRigInput& input, std::vector<double>* errors);

}  // namespace trigpoint
