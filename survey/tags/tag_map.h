// One map of all tags from all runs: bundle adjustment on the tags' corners over tags and bodies, tied by odometry and
// fixed to the world by control points, geotags, GPS or one tag.
#pragma once

#include <Eigen/Core>
#include <array>
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
#include "survey/tags/tag_shape.h"
#include "survey/tags/total_station.h"

namespace trigpoint {

// A point of the scene seen in a picture.
struct SurveyTie {
  int point = 0;         // index into SurveyRun::tie_points
  int64_t stamp_ns = 0;  // of the body pose
  int camera = 0;
  // Whitened tangent plane of the observed ray, camera frame: W * ray = 0 (Camera::BearingSqrtInfo).
  Eigen::Matrix<float, 2, 3> w = Eigen::Matrix<float, 2, 3>::Zero();
};

// A satellite receiver's position.
struct SurveyFix {
  int64_t stamp_ns = 0;
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();  // antenna in the body frame
  Eigen::Vector3d world_m = Eigen::Vector3d::Zero();
  double sigma_h_m = 3, sigma_v_m = 5, sigma_sea_m = 0;  // as GpsFix
};

// One run of pictures, or a set of hand-held stills.
struct SurveyRun {
  std::string name;
  bool stills = false;  // a stitched set: its odometry is the rig, rig_from_cam from photo to photo
  std::string date;     // runs of one date are one session; empty: a session of its own
  std::vector<BodyCamera> cameras;
  std::vector<ImageDetections> images;  // any order; pictures with one stamp are one body pose
  Trajectory odometry;                  // odom_from_body; empty: none
  double scale_sigma = 0.01;            // of the odometry's scale about 1
  double max_gap_s = 2;                 // odometry is not interpolated across a longer gap
  bool levelled = false;                // odometry's z is up
  // What the pictures' features say, if anybody looked: body poses that explain them (odom_from_body, first guess),
  // scene points in that frame and where they are seen, sorted by point.
  Trajectory start;
  std::vector<Eigen::Vector3d> tie_points;
  std::vector<SurveyTie> ties;
  double tie_loss_chi2 = 5.99;  // Huber's threshold, 2 degrees of freedom
  std::vector<SurveyFix> gps;
};

// A surveyed point that is marked in pictures.
struct SurveyMark {
  int run = 0;
  int64_t stamp_ns = 0;
  int camera = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 1;
};

enum class PointRole { kControl, kCheck, kGeotag };
std::string_view RoleName(PointRole role);  // control, check, geotag

// Known coordinates of something fixed to a tag: its centre or corner (control, check), or what stands at a measured
// offset from its centre (the geotag of a station's panorama).
struct SurveyPoint {
  std::string name;
  PointRole role = PointRole::kControl;
  int tag_id = -1;  // -1: marked in pictures
  int corner = -1;  // -1: the centre
  std::vector<SurveyMark> marks;
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();  // world axes, or
  bool offset_in_tag_frame = false;                    // right, out, up in the tag's levelled frame
  Eigen::Vector3d world_m = Eigen::Vector3d::Zero();
  double sigma_h_m = 0.01, sigma_v_m = 0.01;
  bool start_only = false;  // where a total station has it, to begin with: its readings hold the map, not this point
};

// What was read with total stations, and the network of it by itself: where set-ups and points begin, and what is left
// out.
struct SurveyStations {
  std::vector<StationSighting> sightings;
  std::vector<NetworkPoint> known;  // as surveyed
  StationNetwork network;
  Rigid3d level_from_world;  // that the network was adjusted with
};

struct SurveyDistance {
  int from = -1, to = -1;
  double distance_m = 0, sigma_m = 0.005;
  bool check = false;  // compared, not used
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
  std::optional<SurveyStations> stations;
  bool use_control = true, use_geotags = true;  // as datum; else they are compared only
  std::optional<FixedTag> fixed;                // held exactly
  bool fixed_in_world = false;                  // its pose is the site's
  std::vector<int> level_tags;                  // their centres lie on one horizontal plane
  double level_sigma_m = 0.005;
  bool use_gps = false;      // as datum, beside geotags
  bool use_gravity = false;  // levelled odometry holds what is up, where points do not
};

struct SurveyOptions {
  double extra_sigma_px = 0.05;   // added to each corner's sigma in quadrature
  double min_side_px = 12;        // smaller pictures of a tag are not used
  double odometry_rot_deg = 0.3;  // 1 sigma after 1 m, growing with the root of the distance; a tenth of it after 1 s
  double odometry_m = 0.02;       // the same for position, m
  double heading_drift_deg_m = 0.05;  // 1 sigma of a constant drift of odometry's heading, estimated for each run
  double gravity_deg = 0.5;           // 1 sigma of what levelled odometry calls up, a common error of a run
  double corner_shift_px = 0;         // 1 sigma of a shift of all corners towards the tag's centre; 0: there is none
  int variance_rounds = 5;            // rounds of variance component estimation; 0: stated sigmas are believed
  double snooping_chi2 = 31.8;        // a picture of a tag beyond this (8 degrees of freedom) is rejected: 99.99 %
  bool cross_covariances = false;
  bool budget = false;            // SurveyResult::budgets; the caller's choice, no option
  bool self_calibrate = false;    // focal length, principal point and k1, k2 of every camera from the tags, too
  bool check_conventions = true;  // refuse input that follows other conventions than ours
  int max_iterations = 50;
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    visit(self.extra_sigma_px, {"extra_sigma_px", "px", 0.0, 10.0, "added to each corner's sigma in quadrature"});
    visit(self.min_side_px, {"min_side_px", "px", 1.0, 1000.0, "tags with a shorter side in the picture are not used"});
    visit(self.odometry_rot_deg,
          {"odometry_rot_deg", "deg", 1e-4, 90.0,
           "1 sigma of odometry's rotation after 1 m; grows with the square root of the distance"});
    visit(self.odometry_m, {"odometry_m", "m", 1e-5, 10.0,
                            "1 sigma of odometry's position after 1 m; grows with the square root of the distance"});
    visit(self.heading_drift_deg_m, {"heading_drift_deg_m", "deg/m", 0.0, 10.0, "1 sigma of odometry's heading drift"});
    visit(self.gravity_deg, {"gravity_deg", "deg", 1e-3, 45.0, "1 sigma of the vertical of levelled odometry"});
    visit(self.corner_shift_px,
          {"corner_shift_px", "px", 0.0, 5.0,
           "1 sigma of a shift of corners towards the tag's centre, estimated for each camera; 0: none"});
    visit(self.variance_rounds, {"variance_rounds", "", 0, 20, "rounds of variance component estimation"});
    visit(self.snooping_chi2, {"snooping_chi2", "", 1.0, 1e9,
                               "pictures of a tag above this chi-square (8 degrees of freedom) are rejected"});
    visit(self.cross_covariances,
          {"cross_covariances", "", 0, 1, "compute the covariances between all pairs of tags, also of more than 100"});
    visit(self.self_calibrate,
          {"self_calibrate", "", 0, 1,
           "estimate focal length, principal point, k1 and k2 of every camera from the tags, too"});
    visit(self.check_conventions, {"check_conventions", "", 0, 1, "refuse input that follows other conventions"});
    visit(self.max_iterations, {"max_iterations", "", 1, 1000, "most iterations of each solve"});
  }
  std::vector<std::string> Check() const { return CheckRanges(*this); }
};

// How a point agrees with the map.
struct PointAgreement {
  std::string name;
  PointRole role = PointRole::kControl;
  int tag_id = -1;
  Eigen::Vector3d stated_m = Eigen::Vector3d::Zero();       // as surveyed, world
  Eigen::Vector3d error_m = Eigen::Vector3d::Zero();        // map - stated, world axes
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  // of that difference
  double sigma_h_m = 0, sigma_v_m = 0;                      // of that difference, per axis
  double stated_sigma_h_m = 0, stated_sigma_v_m = 0;
  double chi2 = 0;        // standardised: 3 degrees of freedom
  bool used = false;      // took part in the solution
  bool excluded = false;  // control that contradicts the rest and was taken out
  bool checked = false;   // counts in SurveyResult::check: a check point whose tag was not moved
  // Of control that took part: map - stated as it would be without this point, and its sigma.
  std::optional<Eigen::Vector3d> left_out_m;
  Eigen::Vector3d left_out_sigma_m = Eigen::Vector3d::Zero();
  // Does anything but the point hold this axis? A left-out sigma beyond so many stated ones: nothing else does.
  static constexpr double kUnheld = 30;
  bool LeftOutKnown(int axis) const {
    return left_out_m && left_out_sigma_m[axis] < kUnheld * (axis < 2 ? stated_sigma_h_m : stated_sigma_v_m);
  }
};

// One tag in one picture, against the map.
struct SightResidual {
  int run = 0;  // index into SurveyInput::runs
  int64_t stamp_ns = 0;
  int camera = 0;
  int tag_id = -1;
  bool used = false;  // else rejected
  double rms_px = 0;  // of its corners; infinite where the map cannot show it
  double chi2 = 0;    // of the 8 coordinates, with the run's variance factor
};

struct DistanceAgreement {
  SurveyDistance stated;
  double map_m = 0;
  double sigma_m = 0;     // of map - stated (check, excluded), of the residual (used)
  bool excluded = false;  // contradicts the rest and was taken out
};

// How a tag that the datum's plane was told to hold agrees with it.
struct PlaneAgreement {
  int tag_id = -1;
  double height_m = 0;  // above the plane
  double sigma_m = 0;   // of that; 0: nothing but the plane holds it, as three tags always have one
};

// Where geotags or GPS lie against the map's datum.
struct DatumShift {
  std::string of;  // geotags, gps
  int n = 0;
  Eigen::Vector3d stated_minus_map_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();
};

struct RunAgreement {
  std::string name;
  bool stills = false;
  double scale = 1, scale_sigma = 0;            // of the odometry: metres = scale * odometry
  double corner_factor = 1;                     // on the stated sigmas
  Vector6d odometry_factor = Vector6d::Ones();  // the same: rotation x, y, z, translation x, y, z of the body
  double heading_drift_deg_m = 0, heading_drift_sigma_deg_m = 0;
  double corner_shift_px = 0, corner_shift_sigma_px = 0;  // outward, of the first camera; estimated if sigma > 0
  // Self-calibration of the first camera: what it became, and 1 sigma of log f, cx, cy (px), k1, k2.
  std::optional<Camera> camera;
  std::array<double, 5> camera_sigma{};
  int frames = 0, sights = 0, rejected = 0;
  std::vector<int64_t> jumps_ns;  // when odometry jumped: steps that are hardly believed
  double rms_px = 0;
  std::vector<TimedPose> world_from_body;
};

// Kinds of observations in the budget of a tag's uncertainty.
enum class BudgetSource {
  kControl,
  kGeotags,
  kGps,
  kCorners,  // of tags, and marks of points in pictures
  kOdometry,
  kScenePoints,  // tie points
  kDistances,    // measured ones, and readings of total stations
  kOther,        // priors of scales and cameras, planes, gravity; contradictions that were added to the covariance
};
constexpr size_t kBudgetSources = 8;
std::string_view BudgetName(BudgetSource source);  // control, geotags, ..., scene_points, distances, other

// Where the uncertainty of a tag's centre comes from: 1 sigma of its three axes in quadrature; squares of the sources
// add up to that of the total.
struct TagBudget {
  int tag_id = -1;
  double total_m = 0;
  std::array<double, kBudgetSources> sigma_m{};
  BudgetSource LimitedBy() const;  // the largest source
};

// The tag whose centre, surveyed as control with these sigmas, would lower the tags' variances most (predicted). rms,
// worst: over all tags, 1 sigma of three axes in quadrature.
struct NextPoint {
  int tag_id = -1;
  double sigma_h_m = 0, sigma_v_m = 0;
  double rms_now_m = 0, rms_then_m = 0, worst_now_m = 0, worst_then_m = 0;
};

struct CheckSummary {
  int n = 0;
  double rmse_h_m = 0, rmse_v_m = 0, rmse_3d_m = 0;  // map - stated
  // The check points' own sigmas as such errors; in quadrature with the above gives the map's stated accuracy.
  double stated_h_m = 0, stated_v_m = 0;
};

// Surveyed points after a least-squares rigid fit of the map to all of them, where the datum is not the site's.
struct FitToPoints {
  int n = 0;
  double median_m = 0, rmse_m = 0, max_m = 0;
  std::vector<std::pair<std::string, double>> worst;  // point and distance, of those beyond three times the median
};

// A tag that one run saw elsewhere, unless its odometry jumped: the pictures don't tell which.
struct MoveOrJump {
  int tag_id = 0, run = 0;  // run: of SurveyInput
  int64_t jump_ns = 0;      // the first of the jumps that a moved tag would explain
  double moved_m = 0;       // how far it would have moved
  std::string Text(const std::string& run_name) const;
};

// One factor on all tags' sizes, by odometry and known points.
struct CommonSize {
  double log_ratio = 0, sigma = 0;  // logarithm of the size found over the one stated; 1 sigma
};

// One sentence, and what it is about.
struct MapWarning {
  std::string text;
  int tag_id = -1;    // the tag whose status it explains
  std::string point;  // the surveyed point that contradicts the map, or that the map does not have
};

struct SurveyResult {
  std::vector<TagEstimate> tags;  // ascending id
  TagCrossCovariances cross;      // if asked for
  std::string datum;              // what fixes the gauge: control, geotags, tag 6, first camera
  bool in_world = false;          // the datum is the site's
  std::string gauge;              // in words
  std::vector<PointAgreement> points;
  std::vector<DistanceAgreement> distances;
  std::vector<NetworkResidual> station_residuals;  // of SurveyStations::sightings, in the map
  std::vector<PlaneAgreement> plane;
  std::vector<DatumShift> shifts;
  CheckSummary check;  // of points that were not used
  std::optional<FitToPoints> fit;
  std::vector<TagShape> shapes;  // of tags with enough pictures
  std::vector<SightResidual> sights;
  std::vector<RunAgreement> runs;
  std::vector<MoveOrJump> undecided;
  std::optional<CommonSize> common_size;  // where the sizes stated are contradicted (0.1 %)
  std::vector<TagBudget> budgets;         // if asked for; ascending id, of tags that are estimated
  std::optional<NextPoint> next_point;    // the same, where surveyed points are the datum
  std::vector<MapWarning> warnings;
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
