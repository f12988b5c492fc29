#include "localize/run_solution.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

Solution WithImages(const LocalizeInput& input, const std::string& run) {
  Solution s;
  s.run = run;
  s.cameras = input.cameras;
  for (BodyCamera& camera : s.cameras) camera.mask = {};
  for (const FrameImage& image : input.images)
    s.images.push_back({image.stamp_ns, image.name, image.camera, image.pose});
  s.pose_stamps = input.pose_stamps;
  return s;
}

void MoveReconstruction(Reconstruction&& r, double scale_sigma, Solution* s) {
  s->problem = std::move(r.problem);
  s->problem.scales.front().sigma = scale_sigma;
  s->image_of = std::move(r.image_of);
  s->feature_of = std::move(r.feature_of);
  s->depth_m = std::move(r.depth_m);
  s->point_valid = std::move(r.point_valid);
  s->sigma_px = r.sigma_px;
  s->correlation_inflation = r.correlation_inflation;
  s->odometry_noise_factor = r.odometry_noise_factor;
  s->lens_errors = std::move(r.lens_errors);
  s->summary = r.summary;
  s->dropped_observations = r.dropped_observations;
}

SolutionReference ReferenceOf(const ReferenceViews& views, const ReferenceAnswer& answer) {
  const Registration& g = answer.registration;
  SolutionReference r;
  r.name = r.row = views.name;
  r.station = views.station;
  r.status = AnswerStatusName(g.status);
  r.reason = g.reason;
  r.pose = answer.pose;
  r.view_matches = g.view_matches;
  r.agreeing = g.agreeing;
  r.second = g.rival;
  r.support = g.support;
  r.inlier_ratio = g.matched_share;
  r.distance_m = g.distance_m;
  if (answer.geotag_used) r.geotag = answer.geotag_outlier ? "outlier" : "ok";
  r.geotag_difference = answer.geotag_difference;
  if (!views.geotag.has_height) r.geotag_difference.z() = std::nan("");
  return r;
}

}  // namespace

Solution SolutionOf(const LocalizeInput& input, const std::string& run, const std::string& mode,
                    RunReconstruction reconstruction) {
  Solution s = WithImages(input, run);
  s.mode = mode;
  const LoopSummary& loops = reconstruction.loops;
  s.counts = {{"tracks", reconstruction.tracks.tracks},
              {"observations", static_cast<double>(reconstruction.tracked)},
              {"pairs", reconstruction.tracks.pairs},
              {"verified_matches", static_cast<double>(reconstruction.tracks.verified_matches)},
              {"pairs_contradicting_odometry", reconstruction.tracks.odometry_contradicted},
              {"pairs_tried", reconstruction.pairs_tried},
              {"pairs_joined", reconstruction.pairs_joined},
              {"pairs_rejected", static_cast<double>(reconstruction.pairs_rejected.size())},
              {"loops_tried", loops.tried},
              {"loops_found", loops.found},
              {"loops_contradicting", loops.contradicting},
              {"loops_closed", loops.closed},
              {"loops_merged_points", loops.merged_points},
              {"loops_correction_m", loops.correction_m}};
  MoveReconstruction(std::move(reconstruction.reconstruction), input.scale_sigma, &s);
  return s;
}

Reconstruction ReconstructionOf(const LocalizeInput& input, Solution s) {
  const auto same = [](const SolutionImage& a, const FrameImage& b) {
    return a.stamp_ns == b.stamp_ns && a.name == b.name && a.camera == b.camera && a.pose == b.pose;
  };
  if (s.cameras.size() != input.cameras.size() ||
      !std::equal(s.images.begin(), s.images.end(), input.images.begin(), input.images.end(), same)) {
    throw InputError("the solution of run " + s.run + " holds other images than the run has now: run `trigpoint " +
                     "reconstruct` again");
  }
  Reconstruction r;
  r.problem = std::move(s.problem);
  r.image_of = std::move(s.image_of);
  r.feature_of = std::move(s.feature_of);
  r.depth_m = std::move(s.depth_m);
  r.point_valid = std::move(s.point_valid);
  r.sigma_px = s.sigma_px;
  r.correlation_inflation = s.correlation_inflation;
  r.odometry_noise_factor = s.odometry_noise_factor;
  r.lens_errors = std::move(s.lens_errors);
  r.summary = s.summary;
  r.dropped_observations = s.dropped_observations;
  return r;
}

Solution SolutionOf(const LocalizeInput& input, const std::string& run, const std::string& mode,
                    const SolutionCounts& counts, Localization* result) {
  Solution s = WithImages(input, run);
  s.mode = mode;
  s.counts = counts;
  MoveReconstruction(std::move(result->reconstruction), input.scale_sigma, &s);
  s.covariances = std::move(result->pose_covariances);
  for (size_t i = 0; i < result->references.size(); ++i) {
    s.references.push_back(ReferenceOf(input.references[i], result->references[i]));
  }
  if (!result->on_earth) return s;
  SolutionGeoreference& geo = s.georeference.emplace();
  geo.source = result->earth_source;
  geo.origin = input.frame.origin();
  geo.world_from_odom = result->geo.world_from_odom;
  geo.covariance = result->geo.covariance;
  geo.with_poses = std::move(result->with_fit);
  return s;
}

}  // namespace trigpoint
