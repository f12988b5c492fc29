// Bundle adjustment of a hand-held set: rotations, lenses, directions and inverse distances of points, photo centres.
//
// Rig frame: any orthonormal frame, metres; a camera sees a point in direction  R_i (d_j - rho_j c_i),  with R_i
// cam_from_rig, c_i the photo's centre in the rig frame, d_j a direction and rho_j (1/m) the inverse distance from the
// rig's origin. rho = 0 is a point at infinity: points with and without parallax share one form.
//
// Minimises  sum rho(|W (predicted px - observed px)|^2 / sigma^2)
//          + sum_i |((c_i - 0)/r - a_i) / kappa|^2  +  ((ln r - ln r_0) / sigma_ln_r)^2  +  lens priors
//          + w sum_j (rho_j r / tau)^2
// where a_i is the horizontal unit direction in which photo i looks: a phone held in front of a turning person moves on
// a circle about the holder, whose radius r is not known well. Photos alone give the shape of it, up to scale; the
// scale is the prior's until distances are known (localize/references/refine_rig.h). tau is the scene's parallax: from
// a circle, points that are all at one distance look like points at infinity through a longer lens; w makes the points
// count as 50 in that.
//
// Gauge: the first placed photo's rotation is held; the circle's centre is the origin while solving, the mean of the
// photos' centres afterwards. Covariances are relative to that.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "calib/base/progress.h"
#include "survey/panorama/photo_pairs.h"

namespace trigpoint {

struct RigObservation {
  int photo = 0;
  int feature = 0;
  Eigen::Vector2d pixel;
  Eigen::Matrix2d weight = Eigen::Matrix2d::Identity();  // errors count by it: W (predicted - observed), px
};

struct RigPoint {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit, rig frame
  double inverse_distance = 0;                           // 1/m
  double sigma = 0;                                      // of it, 1/m, with the poses held; 0: not estimated
  std::vector<RigObservation> observations;              // of different photos
};

struct RigPhoto {
  bool placed = false;
  int lens = 0;  // index of RigState::lenses
  Eigen::Quaterniond cam_from_rig = Eigen::Quaterniond::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // rig frame, m
};

struct LensPrior {
  double focal_px = 0;       // 0: none
  double sigma_share = 0.1;  // 1 sigma of the focal length, share of it
};

struct RigState {
  std::vector<RigPhoto> photos;
  std::vector<Lens> lenses;
  std::vector<LensPrior> lens_priors;
  std::vector<RigPoint> points;
  double radius_m = 0;  // of the circle
};

struct RigBundleOptions {
  bool centres = false;      // photo centres and distances are free; else all zero
  bool distortion = true;    // k1, k2 and a straight lens' p1, p2 are free
  double sigma_px = 1;       // noise of an observation, weighted
  double huber_px = 3;       // beyond it errors count linearly; 0: Tukey's biweight instead
  double tukey_px = 1.5;     // what lies beyond it has no pull at all: for photos that stand nearly right
  double radius_m = 0.3;     // circle's radius
  double radius_factor = 2;  // 1 sigma of it, as a factor
  double circle_share =
      0.25;  // 1 sigma of a photo's place off the circle, share of the radius; 0: no circle, an arm's length
  double parallax = 0.01;  // 1 sigma of a point's parallax, the circle's radius by its distance, rad
  Eigen::Vector3d up = Eigen::Vector3d::UnitY() * -1;  // in the rig frame
  int max_iterations = 30;
};

struct RigBundleResult {
  double rms_px = 0;  // of all observations
  double cost = 0;
  int iterations = 0;
  // Covariance of [rotation (left tangent of cam_from_rig, rad), centre (m)] of all placed photos, 6 each in order;
  // then the kLensParameters of each lens. Empty unless asked for.
  Eigen::MatrixXd covariance;
  double radius_log_sigma = 0;  // of ln r
  // The covariances are this much larger than independent observations would make them: things that stand together err
  // alike.
  double shared_errors = 1;
  // The photos' part of it if the circle's radius were known: what is known of the rig's shape.
  Eigen::MatrixXd shape_covariance;
};

RigBundleResult SolveRig(const std::vector<PairView>& views, const RigBundleOptions& options, bool with_covariance,
                         const CancelToken& cancel, RigState* state);

// Pixel of a point in a photo; false behind it.
bool ProjectRigPoint(const std::vector<PairView>& views, const RigState& state, const RigPoint& point, int photo,
                     Eigen::Vector2d* pixel);

// 1 sigma of a point's inverse distance (1/m) with the poses held, if its observations are known to 1 px.
double SigmaOfDistance(const std::vector<PairView>& views, const RigState& state, const RigPoint& point);

// Points from pairwise matches: features linked through photos; a chain that meets a photo twice is cut there.
// Directions are the mean of the photos' rays, distances infinite.
std::vector<RigPoint> BuildRigPoints(const std::vector<PairView>& views, const RigState& state,
                                     const std::vector<PhotoPair>& pairs);

// 0 if all photos look one way or back to back, 1 if they look all round: the second largest spread of their right
// sides against half of all.
double LookAround(const RigState& state);
inline constexpr double kOneWay = 0.04;  // LookAround below it: nothing says how far up the photos look

// Up in the rig frame if photos are held without roll: at right angles to their horizontal edges.
Eigen::Vector3d UpFromPhotos(const RigState& state);

// Turns the rig frame: every rotation, centre, direction.
void TurnRig(const Eigen::Quaterniond& new_from_old, RigState* state);
// Moves the origin to `centre` (rig frame, m).
void MoveRigOrigin(const Eigen::Vector3d& centre, RigState* state);

}  // namespace trigpoint
