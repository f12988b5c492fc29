// Robust least squares over poses, small vectors and points, with the points eliminated, and the covariance of what is
// left: for problems whose residuals are Ceres cost functions (the tag map, a planned survey, reference trajectories).
//
//   minimise  1/2 sum rho(|r_f|^2)  +  1/2 sum rho(|W u|^2)
//
// over factors r_f (whitened) and points that are observed along unit rays u. Solved by sparse_system.h; the result
// does not depend on the number of threads. Gauge: constant unknowns or factors fix it, and covariances are relative to
// that. Not thread-safe.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/block_cholesky.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

class SparseSystem;
struct Workers;

class SparseLeastSquares {
 public:
  struct Unknown {
    std::array<double, 7> value{};
    int size = 7;  // 7: a pose with Rigid3Manifold; else that many plain numbers, 6 at most
    bool constant = false;
    int Tangent() const { return size == 7 ? 6 : size; }
  };
  struct Factor {
    std::unique_ptr<ceres::CostFunction> cost;
    const ceres::LossFunction* loss = nullptr;
    std::vector<int> unknowns;
  };
  struct View {
    Rigid3d cam_from_body;
    const ceres::LossFunction* loss = nullptr;
  };
  // residual = W * unit ray of the point in the view; W * observed ray = 0.
  struct PointObservation {
    int point = 0;
    int pose = 0;  // unknown: world_from_body
    int view = 0;
    Eigen::Matrix<float, 2, 3> w = Eigen::Matrix<float, 2, 3>::Zero();
  };

  std::vector<Unknown> unknowns;
  std::vector<Factor> factors;
  std::vector<Eigen::Vector3d> points;  // world, m
  std::vector<View> views;
  std::vector<PointObservation> observations;  // sorted by point

  SparseLeastSquares();
  ~SparseLeastSquares();
  SparseLeastSquares(SparseLeastSquares&&) noexcept;
  SparseLeastSquares& operator=(SparseLeastSquares&&) noexcept;

  int AddPose(const Rigid3d& pose);
  int AddNumbers(const std::vector<double>& values);
  int AddFactor(ceres::CostFunction* cost, const ceres::LossFunction* loss, const std::vector<int>& its_unknowns);
  Rigid3d Pose(int unknown) const;

  struct Summary {
    double cost_before = 0, cost_after = 0;
    int iterations = 0;
    bool converged = false;
  };
  // Unknowns that nothing holds are left out of the equations; what is held too little makes them singular
  // (NumericError). Ends when the step left is below a hundredth of a standard deviation.
  Summary Solve(int max_iterations, int threads, ProgressSink& progress, const CancelToken& cancel);

  // After Linearise, which follows a Solve of the same structure, all at the present state. `open`: what nothing holds
  // gets a sigma that says so; else NumericError.
  void Linearise(int threads, const CancelToken& cancel, bool open = false);
  // Of an unknown's first number among the equations; -1: not estimated. Each unknown has six, of which those it does
  // not need stand alone.
  int Offset(int unknown) const;
  int Equations() const { return 6 * blocks_; }
  // A part of the covariance of all, within two unknowns that share an observation (or that the factor fills in).
  Eigen::MatrixXd Covariance(int row, int column, int rows, int columns) const;
  // Columns [first, first + count) of the whole of it.
  Eigen::MatrixXd CovarianceColumns(int first, int count) const;
  Eigen::MatrixXd SolveNormal(Eigen::MatrixXd right) const;  // covariance of all * right
  // Of the cost at the present state, J' r with robust weights: not quite zero, as Solve ends beside the minimum.
  const Eigen::VectorXd& Gradient() const;
  Matrix6d PoseCovariance(int unknown) const;  // zero for one that is held
  Eigen::VectorXd Residual(int factor) const;  // whitened, before the robust weight
  double Weight(int factor) const;             // rho'
  // J Q J': covariance of the adjusted observations in units of the factor's own, before the robust weight.
  Eigen::MatrixXd AdjustedCovariance(int factor) const;
  // The same times the weight: the part of the observations that the fit takes.
  Eigen::MatrixXd Leverage(int factor) const { return Weight(factor) * AdjustedCovariance(factor); }
  // into += sqrt(weight) J' a, at the rows of the factor's unknowns.
  void AddTransposed(int factor, const Eigen::MatrixXd& a, Eigen::MatrixXd* into) const;
  // sqrt(weight) J x, of as many rows as there are equations.
  Eigen::MatrixXd Times(int factor, const Eigen::MatrixXd& x) const;

 private:
  class Model;
  void Prepare();

  std::vector<int> block_;  // of an unknown: its six equations, -1: none
  int blocks_ = 0;
  std::unique_ptr<SparseSystem> system_;
  BlockCholesky::Inverse inverse_;
};

}  // namespace trigpoint
