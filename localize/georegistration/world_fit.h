// What was measured in the world around a run, as observations in its bundle adjustment (docs/method.md section 5):
// surveyed tags, control points, GPS and geotags. The run's frame lies in the world by a pose of its own, the
// odometry's length is free.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/bundle.h"
#include "localize/georegistration/georegistration.h"
#include "localize/reconstruct/frames.h"

namespace trigpoint {

// GPS as places of the antenna, already interpolated to body poses by the caller.
struct GpsPlace {
  int pose = 0;  // nearest body pose
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d position;  // world, m
  double sigma_h_m = 3, sigma_v_m = 5;
  int64_t stamp_ns = 0;
};

// The corners of a tag in an image: observed unit rays (camera frame) and their W (Camera::BearingSqrtInfo).
struct TagSighting {
  int image = 0;  // index into LocalizeInput::images
  std::array<Eigen::Vector3d, 4> rays;
  std::array<Eigen::Matrix<double, 2, 3>, 4> w;
};

// A point of a tag with surveyed coordinates.
struct TagControl {
  Eigen::Vector3d in_tag = Eigen::Vector3d::Zero();
  Eigen::Vector3d position;  // world, m
  double sigma_h_m = 0.01, sigma_v_m = 0.01;
};

struct WorldTag {
  int id = -1;
  std::array<Eigen::Vector3d, 4> corners;  // tag frame, m
  std::vector<TagSighting> sightings;
  // Where it is, to begin with, from a body pose: that of sightings.front().
  Rigid3d body_from_tag;
  std::optional<Rigid3d> world_from_tag;  // as surveyed; unset: it is not in the map, or not to be used
  std::vector<TagControl> control;
};

struct WorldEvidence {
  bool gps = false;  // every fix is an observation
  std::vector<WorldTag> tags;
  // Of the world_from_tag that there are (left tangents), jointly, in the order of `tags`.
  Eigen::MatrixXd map_covariance;
  bool Any() const { return gps || !tags.empty(); }
};

// The observations that georeference a run without that evidence, and their solution.
struct GeoStart {
  std::vector<GeoObservation> observations;
  std::vector<int> poses;       // of each: its pose in the problem
  std::vector<int> references;  // -1: GPS
  GeoRegistration registration;
};

struct WorldFit {
  bool solved = false;
  std::string reason;             // why not
  int frame = -1;                 // the pose that is world_from_odom
  std::vector<int> map_tags;      // ids that the fit rests on
  std::vector<int> control_tags;  // the same of control
  std::vector<int> left_out;      // tags of the map that stand elsewhere in this run
  bool gps = false, geotags = false;
  std::vector<std::string> warnings;
};

// Adds what was measured to the problem (poses of the tags and of the frame at its end) and solves it; where it is not
// solved, the problem stays as it was. Tags whose place in this run contradicts the map (chi-square, 6 degrees of
// freedom) are left out of it, one at a time. Throws Cancelled.
WorldFit FitWorld(const LocalizeInput& input, const GeoStart& start, const std::vector<GpsPlace>& gps,
                  const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
                  BundleProblem* problem, BundleSummary* summary, ProgressSink& progress, const CancelToken& cancel);

// The georeference that the fit is, as if found by RegisterToEarth, with the covariance of every pose's odom_from_rig
// with it (6 rows a pose, 7 columns). `scale_sigma`: of the odometry's length, which the poses' covariances contain.
GeoRegistration GeoRegistrationOf(const WorldFit& fit, const GeoStart& start, const GeoRegistrationOptions& options,
                                  const BundleProblem& problem, const BundleCovariance& covariance,
                                  Eigen::MatrixXd* with_fit, double* scale_sigma);

}  // namespace trigpoint
