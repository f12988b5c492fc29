// A run by itself: tracks, points and camera poses, loops closed. All that follows extends or reads this.
#pragma once

#include "localize/loops.h"
#include "localize/reconstruct.h"
#include "localize/step_times.h"
#include "localize/tracks.h"

namespace trigpoint {

struct ReconstructRunOptions {
  TrackOptions tracks;
  ReconstructOptions reconstruct;
  LoopOptions loops;

  // As published: consecutive frames, noise as stated.
  static ReconstructRunOptions Paper();

  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.tracks, {"tracks", "", 0, 0, "tracks of features through the images"});
    visit(self.reconstruct, {"reconstruct", "", 0, 0, "points and camera poses"});
    visit(self.loops, {"loops", "", 0, 0, "passages that the run comes back to"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

struct RunReconstruction {
  Reconstruction reconstruction;
  TrackSet tracks;      // without their observations, which are the reconstruction's
  int64_t tracked = 0;  // how many of these there were
  LoopSummary loops;
  StepSeconds seconds;
};

// paper: the published method, without loops. Throws InputError for fewer than 2 images with odometry.
RunReconstruction ReconstructRun(const LocalizeInput& input, const ReconstructRunOptions& options, bool paper,
                                 int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
