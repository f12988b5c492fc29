// Sparse bundle adjustment over rigs, points and the scales of odometries, with exact covariances.
//
// Minimises  sum rho(|W_ij u_ij|^2)  +  sum rho(|L_k e_k|^2)
// where u_ij is the unit ray of point j in view i (predicted), W_ij the whitened tangent plane of the observed ray
// (Camera::BearingSqrtInfo), and e_k pose factors: odometry, priors, geotags, GPS. No singularity on the optical axis.
//
// The points are eliminated (Schur complement, Triggs et al. 2000); the reduced system is sparse and factored by blocks
// (block_cholesky.h), so cost and memory grow linearly with the length of a run without loops. The work is cut into a
// fixed number of chunks that are summed in order: results do not depend on the number of threads.
//
// Gauge: the caller fixes it by constant poses or priors; covariances are relative to those. What is left undetermined
// makes the factorisation fail (NumericError) or, within rounding, a covariance that is huge.
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "calib/base/progress.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

// One observation of a point: residual W * unit(view_from_rig * (rig_from_world * point)), 2 components, whitened.
struct BearingObservation {
  int point = 0;
  int pose = 0;
  int view = 0;
  Eigen::Matrix<float, 2, 3> w;  // W (view frame); W * observed ray = 0
  Eigen::Vector3f ray;           // observed unit ray (view frame)
  bool active = true;            // inactive: kept for the record, no part in the solution
};

// Residual of pose factors, tangent [rotation (rad), translation (m)], whitened by sqrt_info (6 x 6).
struct PoseFactor {
  enum class Kind {
    // pose_a * pose_b^-1 (a_from_b) against `measured` (a_from_b), whose translation is multiplied by a scale if it
    // names one. e = [Log(R_p R_z^T), t_p - s t_z].
    kBetween,
    // rig_from_world of a against `measured`. e = [Log(R R_z^T), t - t_z].
    kPrior,
    // world_from_rig of a against `measured` (world_from_rig), e = [Log(R^T R_z^T), c - c_z], c the centre. With a
    // pose b, that one is world_from_odom and the other poses are rig_from_odom: frame b lies in the world as it says.
    kGeotag,
    // view_a * pose_a * (view_b * pose_b)^-1 (camera a from camera b) against `measured`, whose translation has unit
    // length: e = [Log(R_p R_z^T), t_p / |t_p| - t_z]. What the geometry of two images shows: all but the length.
    kTwoView,
    // A point of the rig (lever arm `arm`, rig frame) in the world against measured.translation; rows 3..5 only. b as
    // for kGeotag.
    kPosition,
    // The point `arm` of rig b (a tag's corner) seen in view_a of a: e = [u, 0], u the unit ray to it in the view.
    // sqrt_info holds the W of a bearing observation in its first two rows, measured.translation the observed ray.
    kRigPoint
  };
  Kind kind = Kind::kPrior;
  int a = 0;
  int b = -1;
  int scale = -1;  // of kBetween: index into BundleProblem::scales; -1: metric
  Rigid3d measured;
  Eigen::Vector3d arm = Eigen::Vector3d::Zero();
  int view_a = 0, view_b = 0;  // of kTwoView: indices into BundleProblem::views
  Matrix6d sqrt_info = Matrix6d::Identity();
  std::shared_ptr<const ceres::LossFunction> loss;  // null: least squares
  double weight = 1.0;                              // rho' at the last evaluation (output)
};

// Where several rigs lie in the world, as measured together (a surveyed map of tags): their errors are correlated.
// Residuals are those of kGeotag, one after the other, whitened jointly.
struct MapFactor {
  std::vector<int> rigs;          // poses, rig_from_odom
  int frame = -1;                 // the pose that is world_from_odom; -1: the problem's frame is the world
  std::vector<Rigid3d> measured;  // world_from_rig of each
  Eigen::MatrixXd sqrt_info;      // 6 n x 6 n
};

// Length of a run: true length = value * what its odometry has measured.
struct OdometryScale {
  double value = 1;
  bool constant = true;
  double prior = 1, sigma = 0.01;  // used when it is free
};

struct BundleProblem {
  std::vector<Rigid3d> poses;                    // rig_from_world
  std::vector<bool> pose_constant;               // same size; empty: none
  std::vector<Rigid3d> views;                    // view_from_rig, constant
  std::vector<Eigen::Vector3d> points;           // world, m
  bool points_constant = false;                  // poses alone move
  std::vector<BearingObservation> observations;  // sorted by point
  std::vector<PoseFactor> factors;
  std::optional<MapFactor> map;
  std::shared_ptr<const ceres::LossFunction> loss;                    // of bearing observations
  std::vector<OdometryScale> scales = std::vector<OdometryScale>(1);  // one a run
  // How far each pose moves (left tangent, 6 rows) with each error that observations share, of one sigma: no residual
  // shows it, covariances contain it. Empty: none is known.
  Eigen::MatrixXd pose_shifts;
};

struct BundleOptions {
  int max_iterations = 50;
  // Stop when the squared distance to the minimum, in standard deviations, is less. Covariances hold only there: the
  // cost of a long run hardly falls while its ends still move by many sigmas.
  double distance_tolerance = 0.05;
  double relative_cost_tolerance = 0;  // or when the cost falls by less than this part of itself, if that will do
  int threads = 0;
};

struct BundleSummary {
  double initial_cost = 0;  // 1/2 sum rho
  double final_cost = 0;
  int iterations = 0;
  bool converged = false;
};

// All points with the poses fixed; each independently. Points that have no finite answer keep their place.
void OptimizePoints(BundleProblem& problem, int iterations, int threads, const CancelToken& cancel);

// Poses, points and scale together (Levenberg-Marquardt). Throws NumericError if the system is singular.
BundleSummary SolveBundle(BundleProblem& problem, const BundleOptions& options, ProgressSink& progress,
                          const CancelToken& cancel);

// Whitened squared residual of one observation at the current state; infinite behind the view.
double SquaredError(const BundleProblem& problem, const BearingObservation& observation);

// Covariance at the current state (which should be the minimum), from the reduced system without damping.
class BundleCovariance {
 public:
  BundleCovariance(const BundleProblem& problem, int threads, const CancelToken& cancel);
  ~BundleCovariance();
  // Of the given poses (rig_from_world, left tangent) jointly: 6 rows and columns each, zero for constant ones.
  Eigen::MatrixXd Joint(const std::vector<int>& poses) const;
  // The covariance of all poses (6 rows each, zero for constant ones) times `b`, which has as many rows.
  Eigen::MatrixXd Times(const Eigen::MatrixXd& b) const;
  // Of half the cost by all poses (6 rows each, zero for constant ones), the points moving along.
  Eigen::VectorXd Gradient() const;
  // Of an odometry's scale; 0 where that is held.
  double ScaleVariance(int scale = 0) const;
  // 6 x 6 covariance of every pose (rig_from_world, left tangent) and its covariance with the next pose in `next`
  // (next[p] >= 0), computed by selected inversion in the place of the factor: the last that this object tells.
  void PoseBlocks(const std::vector<int>& next, std::vector<Matrix6d>* diagonal, std::vector<Matrix6d>* with_next) &&;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint
