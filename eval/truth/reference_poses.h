// The pose of every image of a run from a tag map: a reference for anybody's trajectory.
//
// Unknown are the body's pose at every image, the odometry's scale, and the tags themselves, which the map gives with
// their covariance (jointly where it gives that). Observed are the tags' corners; the run's motion (odometry, or
// odometry and tracks) ties neighbouring images, so that images without a tag are bridged. All in site ENU, whose datum
// is the map's: covariances hold the map's own.
#pragma once

#include <string>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "datasets/io/site.h"
#include "eval/errors/results.h"

namespace trigpoint {

struct ImageDetections;  // survey/tags/tag_files.h

struct ReferencePoseOptions {
  double extra_sigma_px = 0.05;  // added to each corner's sigma in quadrature, px
  double min_side_px = 12;       // smaller pictures of a tag are not used, px
  // 1 sigma of the motion after 1 m, growing with the square root of the distance; a tenth of it after 1 s.
  double motion_rot_deg = 0.3;
  double motion_m = 0.02;    // the same for position, m
  int variance_rounds = 3;   // rounds of variance components; 0: the sigmas above are believed
  double gate_chi2 = 31.8;   // a picture of a tag beyond it (8 degrees of freedom) is rejected: 99.99 %
  double max_gap_s = 2;      // motion is not interpolated across a longer gap, s
  double max_bridge_m = 50;  // an image further from the next one with a tag, along the path, gets no pose, m
  int max_iterations = 30;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.extra_sigma_px, {"extra_sigma_px", "px", 0.0, 10.0, "added to each corner's sigma in quadrature"});
    visit(self.min_side_px, {"min_side_px", "px", 1.0, 1000.0, "detections with a shorter side are not used"});
    visit(self.motion_rot_deg,
          {"motion_rot_deg", "deg", 1e-4, 90.0,
           "1 sigma of the motion's rotation after 1 m; grows with the square root of the distance"});
    visit(self.motion_m, {"motion_m", "m", 1e-5, 10.0,
                          "1 sigma of the motion's position after 1 m; grows with the square root of the distance"});
    visit(self.variance_rounds,
          {"variance_rounds", "", 0, 20, "rounds of variance component estimation; 0: sigmas as stated"});
    visit(self.gate_chi2,
          {"gate_chi2", "", 1.0, 1e9, "detections with a larger chi-square (8 degrees of freedom) are rejected"});
    visit(self.max_gap_s, {"max_gap_s", "s", 0.01, 1000.0, "the motion is not interpolated across a longer gap"});
    visit(self.max_bridge_m,
          {"max_bridge_m", "m", 0.0, 1e6, "images farther, along the path, from an image with a tag get no pose"});
    visit(self.max_iterations, {"max_iterations", "", 1, 1000, "iterations of each solve"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct ReferencePoseInput {
  std::vector<BodyCamera> cameras;
  std::vector<ImageEntry> images;  // of the run
  std::vector<ImageDetections> detections;
  Trajectory motion;            // frame_from_body in any frame, on the body's clock; empty: none, nothing is bridged
  double scale_sigma = 0.01;    // of the motion's scale about 1
  std::vector<TagResult> tags;  // world_from_tag with covariance; without one it counts as exact
  TagCovariances cross;
  TagSizes sizes;  // for tags whose row has no size
};

// status:
//   tags     the image sees at least one tag of the map
//   bridged  it sees none; tied to those that do by the run's motion
//   none     no pose; `reason` says why
struct ReferencePose {
  int64_t stamp_ns = 0;
  std::string image, camera;
  std::string status, reason;
  int tags = 0;
  double bridged_m = 0;  // along the path to the next image with a tag
  std::optional<Rigid3d> world_from_cam;
  Matrix6d covariance = Matrix6d::Zero();  // of its left tangent, rotation (rad) first
};

struct ReferencePoses {
  std::vector<ReferencePose> poses;  // as the input's images
  std::vector<int> tags_used;        // ids, ascending
  int sights = 0, rejected = 0;      // pictures of a tag
  double rms_px = 0;
  double scale = 1, scale_sigma = 0;
  double corner_factor = 1, motion_rot_factor = 1, motion_m_factor = 1;  // on the stated sigmas
  std::vector<std::string> warnings;
};

// Levenberg-Marquardt on the sparse normal equations; a robust solve, data snooping by standardised residuals, variance
// components of corners and motion from redundancies (Foerstner 1979), covariances by selected inversion. The corners'
// factor is never taken below one. Without any tag of the map every pose is `none`. Throws OptionError, InputError for
// a tag without a size, Cancelled.
ReferencePoses EstimateReferencePoses(const ReferencePoseInput& input, const ReferencePoseOptions& options,
                                      ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
