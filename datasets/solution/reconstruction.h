// A run's poses and scene points in its own frame, as `reconstruct` finds them and every solution holds them.
#pragma once

#include <array>
#include <vector>

#include "calib/estimation/bundle.h"

namespace trigpoint {

// A lens against another: shares of the focal length; the principal point, px right and down; shares of distortion by
// r^2 and r^4, where r is 1 in the picture's corners. Or a lens itself (localize/reconstruct/self_calibration.cc).
using LensParameters = std::array<double, 5>;

// Gauge: the first body pose.
struct Reconstruction {
  // Poses (body_from_odom first), views (the cameras' first), points, observations sorted by point, odometry. Its scale
  // is held, unless what lies in the world takes part; scale_sigma is how well the odometry's length is known.
  BundleProblem problem;
  std::vector<int> image_of;      // of each observation: image; -1 - i: reference i
  std::vector<int> feature_of;    // and its feature in features.db
  std::vector<double> depth_m;    // smallest depth of each point
  std::vector<bool> point_valid;  // whether the point is part of the bundle and believed

  double sigma_px = 0;               // noise of a feature, 1 sigma
  double correlation_inflation = 1;  // of it in the weights, as errors along a track are correlated
  // On the assumed noise of odometry: rotation about the body's x, y, z, translation along them.
  Vector6d odometry_noise_factor = Vector6d::Ones();
  // Of each camera, how the images would have its lens instead; empty: as calibrated.
  std::vector<LensParameters> lens_errors;
  // Of each camera five errors of its lens of one sigma each, independent of each other: the root of its covariance.
  // Empty: nothing is left open, or, with lens_errors, what usual calibrations leave open.
  std::vector<LensParameters> lens_roots;
  BundleSummary summary;
  int dropped_observations = 0;
};

}  // namespace trigpoint
