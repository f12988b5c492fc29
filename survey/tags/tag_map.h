// One map of all tags from all runs: bundle adjustment on the tags' corners over tags and bodies, tied by odometry and
// fixed to the world by control points, geotags, GPS or one tag.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/base/option.h"
#include "calib/base/progress.h"
#include "datasets/io/site.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

// One run of pictures, or a set of hand-held stills (no odometry).
struct SurveyRun {
  std::string name;
  std::vector<BodyCamera> cameras;
  std::vector<ImageDetections> images;  // any order; pictures with one stamp are one body pose
  Trajectory odometry;                  // odom_from_body; empty: none
  double scale_sigma = 0.01;            // of the odometry's scale about 1
  double max_gap_s = 2;                 // odometry is not interpolated across a longer gap
};

enum class PointRole { kControl, kCheck, kGeotag };

// Known coordinates of something fixed to a tag: its centre or corner (control, check), or what stands at a measured
// offset from its centre (the geotag of a station's panorama).
struct SurveyPoint {
  std::string name;
  PointRole role = PointRole::kControl;
  int tag_id = -1;
  int corner = -1;                                     // -1: the centre
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  // world axes
  Eigen::Vector3d world_m = Eigen::Vector3d::Zero();
  double sigma_h_m = 0.01, sigma_v_m = 0.01;
};

struct SurveyDistance {
  int from = -1, to = -1;
  double distance_m = 0, sigma_m = 0.005;
};

struct FixedTag {
  int tag_id = -1;
  Rigid3d world_from_tag;
};

struct SurveyInput {
  std::vector<SurveyRun> runs;
  TagSizes sizes;
  std::vector<SurveyPoint> points;
  std::vector<SurveyDistance> distances;
  std::optional<FixedTag> fixed;  // held exactly
};

struct SurveyOptions {
  double extra_sigma_px = 0.05;   // added to each corner's sigma in quadrature
  double min_side_px = 12;        // smaller pictures of a tag are not used
  double odometry_rot_deg = 0.3;  // 1 sigma per square root of a metre (and of a second, a tenth of it)
  double odometry_m = 0.02;       // the same for position, m
  int variance_rounds = 3;        // rounds of variance component estimation; 0: stated sigmas are believed
  double snooping_chi2 = 31.8;    // a picture of a tag beyond this (8 degrees of freedom) is rejected: 99.99 %
  bool cross_covariances = false;
  int max_iterations = 50;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.extra_sigma_px, {"extra_sigma_px", "px", 0.0, 10.0, "added to each corner's sigma in quadrature"});
    visit(self.min_side_px, {"min_side_px", "px", 1.0, 1000.0, "smaller pictures of a tag are not used"});
    visit(self.odometry_rot_deg, {"odometry_rot_deg", "deg", 1e-4, 90.0, "1 sigma per square root of a metre"});
    visit(self.odometry_m, {"odometry_m", "m", 1e-5, 10.0, "1 sigma per square root of a metre"});
    visit(self.variance_rounds, {"variance_rounds", "", 0, 20, "rounds of variance component estimation"});
    visit(self.snooping_chi2, {"snooping_chi2", "", 1.0, 1e9, "pictures of a tag beyond this are rejected"});
    visit(self.cross_covariances, {"cross_covariances", "", 0, 1, "covariances between all pairs of tags"});
    visit(self.max_iterations, {"max_iterations", "", 1, 1000, "of each solve"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// How a point agrees with the map.
struct PointAgreement {
  std::string name;
  PointRole role = PointRole::kControl;
  int tag_id = -1;
  Eigen::Vector3d error_m;              // map - stated, world axes
  double sigma_h_m = 0, sigma_v_m = 0;  // of that difference, both sides in quadrature (check) or stated (others)
  double chi2 = 0;                      // standardised: 3 degrees of freedom
};

struct RunAgreement {
  std::string name;
  double scale = 1, scale_sigma = 0;  // of the odometry: metres = scale * odometry
  double corner_factor = 1, odometry_rot_factor = 1, odometry_m_factor = 1;  // on the stated sigmas
  int frames = 0, sights = 0, rejected = 0;
  double rms_px = 0;
  std::vector<TimedPose> world_from_body;
};

struct CheckSummary {
  int n = 0;
  double rmse_h_m = 0, rmse_v_m = 0, rmse_3d_m = 0;
};

struct SurveyResult {
  std::vector<TagEstimate> tags;  // ascending id
  TagCrossCovariances cross;      // if asked for
  std::string datum;              // what fixes the gauge: control, geotags, tag 6, first camera
  bool in_world = false;          // the datum is the site's
  std::vector<PointAgreement> points;
  CheckSummary check;  // of points that were not used
  std::vector<RunAgreement> runs;
  std::vector<std::string> warnings;
  int iterations = 0;
  double cost_before = 0, cost_after = 0;
};

// Starting values: odometry, planar poses, then resection from tags already placed. Robust solve, variance components
// of corners and odometry per run from redundancies (Foerstner 1979), data snooping by standardised residuals, solve
// again; covariances by sparse selected inversion, relative to `datum`.
// Throws OptionError, InputError (nothing to map, tag without a size), NumericError, Cancelled.
SurveyResult SurveyTags(const SurveyInput& input, const SurveyOptions& options, int threads, ProgressSink& progress,
                        const CancelToken& cancel);

}  // namespace trigpoint
