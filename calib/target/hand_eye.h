// How a camera sits on a robot: cam_from_body from odometry and tags whose places are unknown ("hand-eye").
//
// Minimises the pixel errors of tag corners over cam_from_body, one pose per pass of a tag, and the odometry's scale:
//   pixel(cam_from_body * body_i_from_first * first_from_tag_g * corner_k) - observed
// A pass is a stretch in which one tag is seen without a break and the odometry hardly drifts; each has a frame of its
// own (the body at its first picture), so that drift between passes doesn't matter. The same is what Tsai and Lenz ("A
// new technique for fully autonomous and efficient 3D robotics hand/eye calibration", 1989) solve from pose pairs; here
// with its noise where it arises, in the pixels.
//
// Gauge: none is left but what the motion doesn't show. A vehicle on a plane turns about one axis only: how high the
// camera sits along that axis cannot be seen. A weak prior around the start keeps it there, and the result says so.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct HandEyeOptions {
  double max_pass_s = 20;
  double max_pass_m = 15;
  double max_gap_s = 3;
  double prior_m = 1.0;
  double scale_sigma = 0.02;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.max_pass_s, {"max_pass_s", "s", 0.1, 1e4, "longest time over which the odometry is trusted"});
    visit(self.max_pass_m, {"max_pass_m", "m", 0.1, 1e4, "longest path over which the odometry is trusted"});
    visit(self.max_gap_s, {"max_gap_s", "s", 0.01, 1e4, "a tag that was not seen for longer begins a new pass"});
    visit(self.prior_m,
          {"prior_m", "m", 0.001, 100, "1 sigma of the camera's position about the one in camchain.yaml"});
    visit(self.scale_sigma, {"scale_sigma", "", 0, 1, "1 sigma of the odometry's scale; 0: it is exact"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// One tag in one picture.
struct HandEyeSight {
  int64_t stamp_ns = 0;
  int tag_id = 0;
  Rigid3d odom_from_body;
  std::array<Eigen::Vector3d, 4> corners_m;  // in the tag's frame
  std::array<Eigen::Vector2d, 4> pixels;
};

struct HandEyeResult {
  Rigid3d cam_from_body;
  // Tangent; by leaving out one pass at a time (jackknife), since what the odometry does wrong in a pass is common to
  // all its pictures.
  Matrix6d covariance = Matrix6d::Zero();
  double scale = 1, scale_sigma = 0;  // true length = scale * odometry's
  double rms_px = 0;                  // distance of corners, inliers
  int passes = 0, sights = 0, sights_used = 0;
  // Direction in the body frame along which the camera's place comes from the prior; zero: all were seen.
  Eigen::Vector3d unseen_body = Eigen::Vector3d::Zero();
  double turned_rad = 0;  // largest rotation within a pass
};

// `start`: cam_from_body to begin with; its rotation is also tried turned by multiples of 90 deg about all axes. Throws
// InputError with what is missing (fewer than four passes, hardly any rotation), NumericError, Cancelled.
HandEyeResult CalibrateHandEye(const std::vector<HandEyeSight>& sights, const Camera& camera, const Rigid3d& start,
                               const HandEyeOptions& options, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
