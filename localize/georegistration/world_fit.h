// What was measured in the world around a run, as observations in its bundle adjustment (docs/method.md section 5):
// surveyed tags, control points, GPS and geotags. The run's frame lies in the world by a pose of its own, the
// odometry's length is free.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/bundle.h"
#include "localize/georegistration/georegistration.h"
#include "localize/reconstruct/frames.h"

namespace trigpoint {

constexpr double kLevelled_rad = 0.05 * kDegToRad;  // 1 sigma of the tilt of an odometry that is declared to be level

// GPS as places of the antenna, already interpolated to body poses by the caller.
struct GpsPlace {
  int pose = 0;  // nearest body pose
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d position;                              // world, m
  double sigma_h_m = 3, sigma_v_m = 5, sigma_sea_m = 0;  // as GpsFix
  int64_t stamp_ns = 0;
};

// The corners of a tag in an image: observed unit rays (camera frame) and their W (Camera::BearingSqrtInfo).
struct TagSighting {
  int image = 0;  // index into LocalizeInput::images
  std::array<Eigen::Vector3d, 4> rays;
  std::array<Eigen::Matrix<double, 2, 3>, 4> w;
};

// A point of a tag with surveyed coordinates.
struct TagControl {
  Eigen::Vector3d in_tag = Eigen::Vector3d::Zero();
  Eigen::Vector3d position;  // world, m
  double sigma_h_m = 0.01, sigma_v_m = 0.01;
};

struct WorldTag {
  int id = -1;
  std::array<Eigen::Vector3d, 4> corners;  // tag frame, m
  std::vector<TagSighting> sightings;
  // Where it is, to begin with, from a body pose: that of sightings.front().
  Rigid3d body_from_tag;
  std::optional<Rigid3d> world_from_tag;  // as surveyed; unset: it is not in the map, or not to be used
  std::vector<TagControl> control;
};

struct WorldEvidence {
  bool gps = false;  // every fix is an observation
  std::vector<WorldTag> tags;
  // Of the world_from_tag that there are (left tangents), jointly, in the order of `tags`.
  Eigen::MatrixXd map_covariance;
  bool Any() const { return gps || !tags.empty(); }
};

// The observations that georeference a run without that evidence, and their solution.
struct GeoStart {
  std::vector<GeoObservation> observations;
  std::vector<int> poses;       // of each: its pose in the problem
  std::vector<int> references;  // -1: GPS
  GeoRegistration registration;
};

// What shows by itself where a run lies: points in its frame and in the world, of one tag or panorama.
struct Anchor {
  std::vector<Eigen::Vector3d> odom, world;
};
// Those of the tags that the map or control points place; odom: of `problem`.
std::vector<Anchor> AnchorsOf(const LocalizeInput& input, const std::vector<WorldTag>& tags,
                              const BundleProblem& problem);
// How far off an anchor is, m.
double AnchorDistance(const Anchor& anchor, const Rigid3d& world_from_odom);
constexpr double kAnchorNear_m = 1;  // an anchor this near agrees; odometry drifts until anchors hold it
// world_from_odom that most anchors agree with, of those that two or three of them give, and `known`. Nothing, with the
// reason, where anchors are too few or half of them disagree.
std::optional<Rigid3d> PoseOfAnchors(const std::vector<Anchor>& anchors, const std::optional<Rigid3d>& known,
                                     std::string* reason);

// A geotag as an observation of a rig's place; without a height the site's origin is the best guess.
GeoObservation GeoObservationOf(const GeoTag& tag, const LocalFrame& frame, const Rigid3d& odom_from_rig);
// Those of references that have a pose (`pose_of`, -1: none) in `problem`. The photos of one hand-held set share a
// geotag, which is one statement: it counts once, for the first photo that has a pose.
GeoStart GeotagsOf(const LocalizeInput& input, const std::vector<int>& pose_of, const BundleProblem& problem);
// Whether a position is beyond the gate; off: said - estimated, world, m.
bool IsOutlier(const GeoObservation& o, const Eigen::Vector3d& off, const GeoRegistrationOptions& options);

struct WorldFit {
  bool solved = false;
  std::string reason;             // why not
  int frame = -1;                 // the pose that is world_from_odom; -1: the problem's frame is the world
  int first_tag = -1;             // the pose of the first tag, the others follow
  std::vector<int> map_tags;      // ids that the fit rests on
  std::vector<int> control_tags;  // the same of control
  std::vector<int> left_out;      // tags of the map that stand elsewhere in this run
  bool gps = false, geotags = false;
  std::vector<std::string> warnings;
};

// What a fit rests on, in words: "geotags, tags and control".
std::string SourceOf(const WorldFit& fit);

// Adds what was measured to the problem (poses of the tags and of the frame at its end) and solves it; where it is not
// solved, the problem stays as it was. Tags whose place in this run contradicts the map (chi-square, 6 degrees of
// freedom) are left out of it, one at a time. Throws Cancelled.
WorldFit FitWorld(const LocalizeInput& input, const GeoStart& start, const std::vector<GpsPlace>& gps,
                  const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
                  BundleProblem* problem, BundleSummary* summary, ProgressSink& progress, const CancelToken& cancel);

// Where a run's images show a tag, which may stand elsewhere than in others' images.
struct TagInRun {
  int run = 0, tag_id = -1;
};

// The same for several runs whose poses lie in the world already (rig_from_world). `run_of_image`: of input.images;
// `gps`: of each run. `links`: factors of a first solution that brings the runs together, as far off as they may be.
// Where most corners that a run shows of a tag that others show, too, are outliers, the tag is not the same one for
// that run: `moved`. `after_links` is called once the runs lie where they belong, and may join points of the problem.
struct SiteFitInput {
  std::vector<int> run_of_image;
  std::vector<std::vector<GpsPlace>> gps;
  std::vector<PoseFactor> links;
  std::function<void()> after_links;
};
WorldFit FitSite(const LocalizeInput& input, const GeoStart& start, const SiteFitInput& site,
                 const WorldEvidence& evidence, const GeoRegistrationOptions& options, const BundleOptions& bundle,
                 BundleProblem* problem, BundleSummary* summary, std::vector<TagInRun>* moved, ProgressSink& progress,
                 const CancelToken& cancel);

// The georeference that the fit is, as if found by RegisterToEarth, with the covariance of every pose's odom_from_rig
// with it (6 rows a pose, 7 columns). `scale_sigma`: of the odometry's length, which the poses' covariances contain.
GeoRegistration GeoRegistrationOf(const WorldFit& fit, const GeoStart& start, const GeoRegistrationOptions& options,
                                  const BundleProblem& problem, const BundleCovariance& covariance,
                                  Eigen::MatrixXd* with_fit, double* scale_sigma);

}  // namespace trigpoint
