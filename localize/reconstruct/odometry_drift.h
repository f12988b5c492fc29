// Does a run's odometry turn more to one side than its images, evenly along its path?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/geometry/pose_readings.h"
#include "datasets/io/trajectory.h"

namespace trigpoint {

struct OdometryDrift {
  Eigen::Vector3d rad_m = Eigen::Vector3d::Zero();        // rotation vector a metre travelled, body axes
  Eigen::Vector3d sigma_rad_m = Eigen::Vector3d::Zero();  // 1 sigma, each axis
  // Of it what neither stated noise nor chance explains: zero about the other axes.
  Eigen::Vector3d significant_rad_m = Eigen::Vector3d::Zero();
  double length_m = 0;       // of the path
  double noise_rad = 0;      // what odometry's stated noise adds up to over it, 1 sigma per axis
  bool significant = false;  // neither that noise nor chance makes it likely
};

// The rotation a metre by which odometry turns more than images do. Least squares with Huber's weights; the noise is
// found from the residuals. `noise_rad`: of odometry over the whole path, by its stated noise; 0: not stated, and no
// drift is significant. Nothing where fewer than eight independent motions can be compared.
std::optional<OdometryDrift> FindDrift(const std::vector<Rigid3d>& odom_from_body,
                                       const std::vector<MeasuredMotion>& motions, double noise_rad);

// The poses with steps that are turned back by the drift; lengths of steps and the first pose stay.
std::vector<Rigid3d> WithoutDrift(const std::vector<Rigid3d>& odom_from_body, const Eigen::Vector3d& rad_m);

// How many times larger than stated odometry's noise is, by the median difference of its rotations from those of the
// images, which have noise of their own; 1 where the difference may be chance (0.1 %), or too few motions can be
// compared. `variances`: of odometry as stated, from the first pose to each, rad^2 per axis; empty: unknown.
double TurnNoise(const std::vector<Rigid3d>& odom_from_body, const std::vector<MeasuredMotion>& motions,
                 const std::vector<double>& variances);

// "its heading drifts by +0.34 deg a metre (1 sigma 0.01), ...": of the axis that drifts most.
std::string DriftText(const OdometryDrift& drift);

// Odometry whose steps are turned back by the drift; lengths of steps and the first pose stay. The metres are those of
// FindDrift, between the poses that it was found at (`stamps_ns`, ascending, and `odom_from_body`): odometry's own path
// is longer, by the noise of its steps. Needs at least one of these poses.
Trajectory WithoutDrift(const Trajectory& odometry, const std::vector<int64_t>& stamps_ns,
                        const std::vector<Rigid3d>& odom_from_body, const Eigen::Vector3d& rad_m);

}  // namespace trigpoint
