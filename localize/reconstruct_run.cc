#include "localize/reconstruct_run.h"

#include <utility>

#include "calib/base/error.h"

namespace trigpoint {

ReconstructRunOptions ReconstructRunOptions::Paper() {
  ReconstructRunOptions o;
  o.tracks.mode = "paper";
  o.tracks.ratio = 0.7;
  o.tracks.max_gap = 1;
  o.reconstruct.sigma_px = 1;
  o.reconstruct.estimate_sigma = false;
  o.reconstruct.estimate_odometry = false;
  o.reconstruct.loss = "dcs";
  o.reconstruct.loss_chi2 = 1;
  return o;
}

RunReconstruction ReconstructRun(const LocalizeInput& input, const ReconstructRunOptions& options, bool paper,
                                 int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  if (input.odom_from_body.size() < 2) throw InputError("a reconstruction needs at least 2 images with odometry");
  RunReconstruction run;
  StepTimes steps(&run.seconds);
  run.tracks = BuildTracks(input, options.tracks, threads, seed, progress, cancel);
  run.tracked = static_cast<int64_t>(run.tracks.observations.size());
  steps.End("tracks");
  run.reconstruction = Reconstruct(input, run.tracks.tracks, std::exchange(run.tracks.observations, {}),
                                   options.reconstruct, paper, threads, progress, cancel);
  steps.End("reconstruct");
  if (!paper) {
    run.loops =
        CloseLoops(input, options.loops, {}, options.reconstruct, &run.reconstruction, threads, seed, progress, cancel);
    steps.End("loops");
  }
  return run;
}

}  // namespace trigpoint
