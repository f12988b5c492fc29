#include "localize/run_solution.h"

#include <algorithm>
#include <cmath>

#include "calib/base/error.h"

namespace trigpoint {
namespace {

constexpr char kAligned[] = "aligned";  // among the counts: observations

Solution WithImages(const LocalizeInput& input, const std::string& run, Reconstruction reconstruction) {
  Solution s;
  static_cast<Reconstruction&>(s) = std::move(reconstruction);
  s.problem.scales.front().sigma = input.scale_sigma;
  s.run = run;
  s.cameras = input.cameras;
  for (BodyCamera& camera : s.cameras) camera.mask = {};
  s.images = input.images;
  s.pose_stamps = input.pose_stamps;
  return s;
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
  Solution s = WithImages(input, run, std::move(reconstruction.reconstruction));
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
              {kAligned, static_cast<double>(reconstruction.aligned)},
              {"loops_tried", loops.tried},
              {"loops_found", loops.found},
              {"loops_contradicting", loops.contradicting},
              {"loops_closed", loops.closed},
              {"loops_merged_points", loops.merged_points},
              {"loops_correction_m", loops.correction_m}};
  return s;
}

bool HasAlignedPoints(const SolutionCounts& counts) {
  return std::any_of(counts.begin(), counts.end(), [](const auto& c) { return c.first == kAligned && c.second > 0; });
}

Reconstruction ReconstructionOf(const LocalizeInput& input, Solution s) {
  const auto same = [](const FrameImage& a, const FrameImage& b) {
    return a.stamp_ns == b.stamp_ns && a.name == b.name && a.camera == b.camera && a.pose == b.pose;
  };
  if (s.cameras.size() != input.cameras.size() ||
      !std::equal(s.images.begin(), s.images.end(), input.images.begin(), input.images.end(), same)) {
    throw InputError("the solution of run " + s.run + " holds other images than the run has now: run `trigpoint " +
                     "reconstruct` again");
  }
  return std::move(static_cast<Reconstruction&>(s));
}

Solution SolutionOf(const LocalizeInput& input, const std::string& run, const std::string& mode,
                    const SolutionCounts& counts, Localization* result) {
  Solution s = WithImages(input, run, std::move(result->reconstruction));
  s.mode = mode;
  s.counts = counts;
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
