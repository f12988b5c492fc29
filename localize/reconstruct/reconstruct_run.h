// A run by itself: tracks, points and camera poses, loops closed. All that follows extends or reads this.
#pragma once

#include "localize/reconstruct/loops.h"
#include "localize/reconstruct/reconstruct.h"
#include "localize/reconstruct/rolling_shutter.h"
#include "localize/reconstruct/step_times.h"
#include "localize/reconstruct/structure_from_motion.h"
#include "localize/reconstruct/tracks.h"
#include "localize/reconstruct/view_graph.h"

namespace trigpoint {

struct ReconstructRunOptions {
  TrackOptions tracks;
  ViewGraphOptions pairs;
  ReconstructOptions reconstruct;
  LoopOptions loops;
  bool align_patches = true;      // the pictures about features; not of photos far apart, not in paper mode
  bool check_conventions = true;  // refuse odometry and calibrations that images contradict; for the caller

  StructureFromMotionOptions motion;

  // As published: consecutive frames, noise as stated.
  static ReconstructRunOptions Paper();

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.tracks, {"tracks", "", 0, 0, "tracks of features through the images"});
    visit(self.pairs, {"pairs", "", 0, 0, "pairs of images beyond neighbours in time"});
    visit(self.reconstruct, {"reconstruct", "", 0, 0, "points and camera poses"});
    visit(self.align_patches, {"align_patches", "", 0, 1,
                               "align the pictures about a point's features with each other, where images are close "
                               "together; it takes half as long as the rest"});
    visit(self.check_conventions,
          {"check_conventions", "", 0, 1,
           "refuse odometry that images or GPS contradict (order, signs, axes, unit, jumps) and "
           "calibrations that images contradict"});
    visit(self.motion, {"motion", "", 0, 0, "motion of runs without odometry, from images alone"});
    visit(self.loops, {"loops", "", 0, 0, "places that the run comes back to"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct RunReconstruction {
  Reconstruction reconstruction;
  TrackSet tracks;                        // without their observations, which are the reconstruction's
  int64_t tracked = 0;                    // how many of these there were
  int pairs_tried = 0;                    // beyond the neighbours in time
  int pairs_joined = 0;                   // verified, and in agreement with odometry and each other
  std::vector<ImagePair> pairs_rejected;  // verified, but contradicted
  LoopSummary loops;
  int64_t alignments_tried = 0, aligned = 0;  // observations aligned with their points' pictures
  std::vector<ReadoutEstimate> readout;  // of the cameras' rolling shutters, as the images show it; not in paper mode
  StepSeconds seconds;
};

// paper: the published method, without loops. Throws InputError for fewer than 2 images with odometry.
RunReconstruction ReconstructRun(const LocalizeInput& input, const ReconstructRunOptions& options, bool paper,
                                 int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
