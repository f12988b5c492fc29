// Which images see the same space, tied by two-view geometry: what a run's images share beyond the neighbours in time.
#pragma once

#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "calib/estimation/bundle.h"
#include "localize/reconstruct/frames.h"
#include "localize/reconstruct/tracks.h"
#include "localize/reconstruct/two_view.h"

namespace trigpoint {

struct ViewGraphOptions {
  double video_step_m = 2.5;   // median distance of consecutive images: beyond it, a run's images are photos, not video
  int neighbours = 10;         // pairs an image is the first to ask for, at most
  int exhaustive = 40;         // runs of so many images and fewer: every image asks for every other
  double spacing_m = 1.5;      // longer runs: path between two images that ask; between the partners of one, half of it
  double viewpoint_deg = 40;   // largest change of viewpoint between two images of a pair
  int connected = 80;          // tracks that two images share already: such a pair needs no more
  double ratio = 0.7;          // ratio test: best / second-best distance
  double max_distance = 0.75;  // largest distance of unit descriptors
  double inlier_px = 2.0;      // largest distance from the epipolar line
  double drift_part = 0.01;    // drift of odometry's positions beyond its noise, part of the path, 1 sigma
  double drift_deg_m = 0.04;   // and of its directions, a metre
  double gate_chi2 = 20.5;     // of a pair against odometry, and against the other pairs: chi-square, 5 dof, 0.1 %
  double min_parallax_deg = 2;  // of a track of two images

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.video_step_m,
          {"video_step_m", "m", 0, 1000,
           "a run with a larger median step has photos, not video: neighbours in time are paired like others"});
    visit(self.neighbours, {"neighbours", "images", 0, 1000, "most pairs proposed for each image; 0: none"});
    visit(self.exhaustive, {"exhaustive", "images", 0, 1000, "runs of up to this many images: all pairs are tried"});
    visit(self.spacing_m, {"spacing_m", "m", 0, 1000, "path length between images for which pairs are proposed"});
    visit(self.viewpoint_deg, {"viewpoint_deg", "deg", 5, 90, "largest change of viewpoint within a pair"});
    visit(self.connected,
          {"connected", "tracks", 1, 100000, "images that share this many tracks are not paired again"});
    visit(self.ratio, {"ratio", "", 0.3, 1.0, "ratio test: best / second-best distance"});
    visit(self.max_distance, {"max_distance", "", 0.1, 1.4, "largest distance of unit descriptors"});
    visit(self.inlier_px, {"inlier_px", "px", 0.2, 20, "largest distance from the epipolar line"});
    visit(self.drift_part, {"drift_part", "", 0, 1, "drift of odometry beyond its noise, part of the path, 1 sigma"});
    visit(self.drift_deg_m, {"drift_deg_m", "deg/m", 0, 10, "drift of odometry's directions, 1 sigma"});
    visit(self.gate_chi2,
          {"gate_chi2", "", 1, 10000, "gate of a pair against odometry and other pairs: chi-square, 5 dof"});
    visit(self.min_parallax_deg, {"min_parallax_deg", "deg", 0, 30, "least parallax of a track of two images"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// Two images, a before b.
struct ImagePair {
  int a = 0, b = 0;
};

// Pairs that odometry predicts to see the same space and that `tracks` do not connect yet; a bounded number an image.
// Of few images all pairs. Images of one moment are no pair: how a rig's cameras stand to each other is calibrated.
std::vector<ImagePair> CandidatePairs(const LocalizeInput& input, const TrackSet& tracks,
                                      const ViewGraphOptions& options);

// A verified pair.
struct ViewEdge {
  ImagePair pair;
  WideBaselineResult geometry;
  Matches candidates;  // before the pairs decided together; empty afterwards
  std::vector<std::pair<TrackObservation, TrackObservation>> matches;
};

struct ViewGraph {
  std::vector<ViewEdge> edges;  // the least likely to be chance first
  int tried = 0;
  int verified = 0;                     // by two-view geometry
  std::vector<ImagePair> rejected;      // verified, but contradicted by odometry or by the other pairs
  OdometryNoise odometry_noise;         // by neighbouring images; above 1 only where they agree among themselves, and
                                        // not with odometry
  std::vector<Rigid3d> odom_from_body;  // odometry bent to the pairs: where a bundle adjustment starts
};

// Matches and verifies the pairs, rejects those that contradict odometry (`odometry`: factors between body poses) or
// each other. `views`: cam_from_body of the cameras.
ViewGraph BuildViewGraph(const LocalizeInput& input, const std::vector<ImagePair>& pairs,
                         const std::vector<PoseFactor>& odometry, const ViewGraphOptions& options, int threads,
                         uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

// The pairs that images alone verify, without odometry; the matches of an edge are those that fit its geometry.
std::vector<ViewEdge> VerifyPairs(const LocalizeInput& input, const std::vector<ImagePair>& pairs,
                                  const ViewGraphOptions& options, int threads, uint64_t seed, ProgressSink& progress,
                                  const CancelToken& cancel);

// Of an edge: triangles it is part of, and those along which the rotations add up to none.
struct Triangles {
  int closed = 0, all = 0;
};
std::vector<Triangles> CountTriangles(const std::vector<ViewEdge>& edges);

// Tracks joined by the matches of the graph's edges; those of two images are kept where their parallax suffices.
TrackSet JoinTracks(const LocalizeInput& input, const ViewGraph& graph, const TrackSet& tracks,
                    const ViewGraphOptions& options, int min_length);

}  // namespace trigpoint
