#include "localize/reconstruct/reconstruct_run.h"

#include <cmath>
#include <utility>

#include "calib/base/error.h"
#include "localize/reconstruct/patch_alignment.h"

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

namespace {

// Joins the run's tracks by the pairs of its view graph.
ReconstructStart JoinPairs(const LocalizeInput& input, const ReconstructRunOptions& options, int threads, uint64_t seed,
                           ProgressSink& progress, const CancelToken& cancel, RunReconstruction* run) {
  const std::vector<ImagePair> pairs = CandidatePairs(input, run->tracks, options.pairs);
  const ViewGraph graph = BuildViewGraph(input, pairs, OdometryFactors(input, options.reconstruct, Vector6d::Ones()),
                                         options.pairs, threads, seed, progress, cancel);
  run->tracks = JoinTracks(input, graph, run->tracks, options.pairs, options.tracks.min_length);
  run->pairs_tried = graph.tried;
  run->pairs_joined = static_cast<int>(graph.edges.size());
  run->pairs_rejected = graph.rejected;
  progress.Log(LogLevel::kInfo, std::to_string(graph.tried) +
                                    " pairs of images matched: " + std::to_string(graph.verified) + " verified, " +
                                    std::to_string(graph.rejected.size()) +
                                    " of them rejected, as odometry or other pairs contradict them");
  return {graph.odom_from_body, graph.odometry_noise};
}

// Images' own motion holds the gauge, its length among it, and nothing else.
ReconstructRunOptions WithoutOdometry(ReconstructRunOptions o) {
  o.reconstruct.odometry_rotation_deg = 20;
  o.reconstruct.odometry_translation_m = 0.01;
  o.reconstruct.odometry_translation_part = 0.05;
  o.reconstruct.estimate_odometry = false;
  return o;
}

// A start at what is solved already.
ReconstructStart From(const Reconstruction& solved, ReconstructStart start) {
  for (size_t k = 0; k < start.odom_from_body.size(); ++k) {
    start.odom_from_body[k] = solved.problem.poses[k].Inverse();
  }
  start.near = true;
  return start;
}

// Reconstructs again, with observations that show the same spot of their points.
void AlignPoints(const LocalizeInput& input, const ReconstructStart& start, const ReconstructOptions& options,
                 int threads, ProgressSink& progress, const CancelToken& cancel, RunReconstruction* run) {
  if (!input.image_picture) return;
  Reconstruction& r = run->reconstruction;
  AlignedTracks tracks = AlignPatches(input, r, threads, progress, cancel);
  run->alignments_tried = tracks.tried;
  run->aligned = tracks.aligned;
  const ReconstructStart solved = From(r, start);
  const int points = static_cast<int>(r.problem.points.size());
  r = {};
  r = Reconstruct(input, solved, points, std::move(tracks.observations), options, false, threads, progress, cancel);
  progress.Log(LogLevel::kInfo, std::to_string(run->aligned) + " of " + std::to_string(run->alignments_tried) +
                                    " observations aligned with the pictures of their points");
}

// Reconstructs again, with rays that are corrected for the cameras' translation while their rows were read out.
void ReadOutRows(const LocalizeInput& input, const ReconstructStart& start, const ReconstructOptions& options,
                 int threads, ProgressSink& progress, const CancelToken& cancel, Reconstruction* r) {
  if (!HasReadout(input.cameras)) return;
  *r = Reconstruct(input, From(*r, start), static_cast<int>(r->problem.points.size()), AtImageTimes(input, *r), options,
                   false, threads, progress, cancel);
}

// None where the images do not determine it.
std::vector<ReadoutEstimate> ReadoutTimes(const LocalizeInput& input, const Reconstruction& r) {
  try {
    return EstimateReadout(input, r);
  } catch (const NumericError&) {
    return {};
  }
}

}  // namespace

RunReconstruction ReconstructRun(const LocalizeInput& input, const ReconstructRunOptions& given, bool paper,
                                 int threads, uint64_t seed, ProgressSink& progress, const CancelToken& cancel) {
  const ReconstructRunOptions options = input.has_odometry ? given : WithoutOdometry(given);
  if (input.odom_from_body.size() < 2) throw InputError("a reconstruction needs at least 2 images with odometry");
  RunReconstruction run;
  StepTimes steps(&run.seconds);
  // Neighbours in time are followed along epipolar curves only where they see nearly the same.
  const bool video = MedianStep(input) <= options.pairs.video_step_m;
  if (paper || video || options.pairs.neighbours == 0)
    run.tracks = BuildTracks(input, options.tracks, threads, seed, progress, cancel);
  steps.End("tracks");
  ReconstructStart start{input.odom_from_body};
  if (!paper && options.pairs.neighbours > 0) {
    start = JoinPairs(input, options, threads, seed, progress, cancel, &run);
    steps.End("pairs");
  }
  run.tracked = static_cast<int64_t>(run.tracks.observations.size());
  run.reconstruction = Reconstruct(input, start, run.tracks.tracks, std::exchange(run.tracks.observations, {}),
                                   options.reconstruct, paper, threads, progress, cancel);
  steps.End("reconstruct");
  if (!paper) {
    run.loops =
        CloseLoops(input, options.loops, {}, options.reconstruct, &run.reconstruction, threads, seed, progress, cancel);
    steps.End("loops");
    if (options.align_patches && video) AlignPoints(input, start, options.reconstruct, threads, progress, cancel, &run);
    steps.End("alignment");
    ReadOutRows(input, start, options.reconstruct, threads, progress, cancel, &run.reconstruction);
    run.readout = ReadoutTimes(input, run.reconstruction);
    steps.End("rolling shutter");
  }
  return run;
}

}  // namespace trigpoint
