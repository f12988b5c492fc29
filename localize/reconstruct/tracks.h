// Tracks of features through an image stream (docs/method.md section 1).
#pragma once

#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/matching.h"

namespace trigpoint {

struct TrackOptions {
  std::string mode = "trigpoint";    // trigpoint: guided matching over several gaps; paper: consecutive frames only
  double ratio = 0.8;                // ratio test between consecutive frames (paper: 0.7)
  double guided_ratio = 0.85;        // ratio test among the candidates along an epipolar curve
  double max_distance = 0.75;        // largest distance of unit descriptors
  double inlier_px = 2.0;            // largest distance from the epipolar line (paper: homography, 3 px)
  double homography_px = 3.0;        // RANSAC threshold of the homography (paper mode)
  int max_gap = 8;                   // longest gap bridged, frames; gaps 2, 3, 4, 6, 9, ... are tried
  int min_length = 3;                // shortest track kept, images
  double min_depth_m = 1.5;          // nearest point searched for
  double sigma_rotation_deg = 1.0;   // how far odometry's rotation between two frames may be off, 1 sigma
  double sigma_direction_deg = 6.0;  // the same for its direction of motion

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.ratio, {"ratio", "", 0.3, 1.0, "ratio test between consecutive frames: best / second-best distance"});
    visit(self.guided_ratio, {"guided_ratio", "", 0.3, 1.0, "ratio test among candidates along an epipolar curve"});
    visit(self.max_distance, {"max_distance", "", 0.1, 1.4, "largest distance of unit descriptors"});
    visit(self.inlier_px, {"inlier_px", "px", 0.2, 20, "largest distance from the epipolar line"});
    visit(self.homography_px, {"homography_px", "px", 0.5, 50, "RANSAC threshold of the homography (paper mode)"});
    visit(self.max_gap, {"max_gap", "frames", 1, 64, "longest gap bridged; gaps 2, 3, 4, 6, 9, ... are tried"});
    visit(self.min_length, {"min_length", "images", 2, 100, "shortest track kept"});
    visit(self.min_depth_m, {"min_depth_m", "m", 0.05, 100, "nearest point searched for"});
    visit(self.sigma_rotation_deg,
          {"sigma_rotation_deg", "deg", 0.01, 45, "how far odometry's rotation between frames may be off, 1 sigma"});
    visit(self.sigma_direction_deg,
          {"sigma_direction_deg", "deg", 0.01, 90, "how far odometry's direction of motion may be off, 1 sigma"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct TrackObservation {
  int track = 0;
  int image = 0;
  int feature = 0;
  Eigen::Vector2f pixel;
};

struct TrackSet {
  int tracks = 0;
  std::vector<TrackObservation> observations;  // by track, then image; one per image and track
  int64_t verified_matches = 0;
  int pairs = 0;
  int odometry_contradicted = 0;  // pairs whose images disagree with odometry
};

// A window slides over the images: the features of at most `max_gap` + a batch of them are in memory at a time, and the
// tracks that leave it are done.
TrackSet BuildTracks(const LocalizeInput& input, const TrackOptions& options, int threads, uint64_t seed,
                     ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
