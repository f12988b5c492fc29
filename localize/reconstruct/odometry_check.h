// Is a run's odometry what file_formats.md says? Its poses are compared with motions that the images alone show.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/geometry/pose_readings.h"
#include "datasets/io/trajectory.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/odometry_drift.h"
#include "localize/reconstruct/view_graph.h"

namespace trigpoint {

struct OdometryCheckOptions {
  int pairs = 24;             // pairs of images compared where all agree; four times as many where some do not
  int most_apart = 16;        // images between the two of a pair
  double ratio = 0.75;        // ratio test: best / second-best distance
  double inlier_px = 1.5;     // largest distance from the epipolar line
  int least_matches = 40;     // verified matches of a pair
  double least_deg = 2;       // median motion of the matches between the two images of a pair
  double most_sigma_deg = 6;  // of a direction of translation that is compared
  double noise_rad = 0;       // what the rotations' stated noise adds up to over the run, 1 sigma per axis; 0: unknown
  // The same from the first pose to each, with what limits odometry, rad^2 per axis; empty: unknown.
  std::vector<double> rotation_variances;
};

// Motions between pairs of images spread over the run, from their matches alone. Deterministic for any `threads`.
std::vector<MeasuredMotion> MeasureMotions(const LocalizeInput& input, const std::vector<int>& first_images,
                                           const OdometryCheckOptions& options, int threads, uint64_t seed,
                                           const CancelToken& cancel);

// What images say of a run's odometry.
struct OdometryFinding {
  std::optional<std::string> contradiction;  // why it cannot be used
  std::optional<OdometryDrift> drift;        // else: a significant one, without which it can
  double noise = 1;                          // how many times larger than stated it is; 1: as stated, or less
};

// Compares the readings of odometry with the images. Where most motions contradict it as read: a message that names the
// reading which agrees, and what to do; where it turns as the images do at other times, a message that names the offset
// of its clock. Nothing where it agrees, or where too few motions can be compared. `whole`: the odometry at all of its
// own times, which the input has at the images' only. `odometry` names the file in messages.
OdometryFinding CheckOdometry(const LocalizeInput& input, const Trajectory& whole, const std::string& odometry,
                              const OdometryCheckOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                              const CancelToken& cancel);

// A message where no pair of images agrees with odometry, as `rejected` has at least three consecutive ones and half of
// all. The check before the reconstruction lets odometry pass whose motions are a few degrees off, and a few pairs do
// not show its noise; the result would rest on odometry alone.
std::optional<std::string> ContradictedByPairs(const LocalizeInput& input, const std::vector<ImagePair>& rejected,
                                               const std::string& odometry);

}  // namespace trigpoint
