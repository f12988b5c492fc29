// Robust least squares over poses and small vectors, with points eliminated, and the covariance of what is left:
// internal to survey/tags.
//
//   minimise  1/2 sum rho(|r_f|^2)  +  1/2 sum rho(|W u|^2)
//
// over factors r_f (Ceres cost functions, whitened) and tie points seen along unit rays u. Levenberg-Marquardt; tie
// points by the Schur complement (Triggs et al. 2000). The work is cut into a fixed number of chunks that are summed in
// order: the result does not depend on the number of threads.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/block_cholesky.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct Unknown {
  std::array<double, 7> value{};
  int size = 7;  // 7: a pose with Rigid3Manifold, else that many plain numbers
  bool constant = false;
  int Tangent() const { return size == 7 ? 6 : size; }
};

struct Factor {
  std::unique_ptr<ceres::CostFunction> cost;
  const ceres::LossFunction* loss = nullptr;
  std::vector<int> unknowns;
};

// A point of the world that pictures show; `inverse_sigma` above zero where coordinates are known beforehand.
struct TiePoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d known = Eigen::Vector3d::Zero();
  Eigen::Vector3d inverse_sigma = Eigen::Vector3d::Zero();
};

struct TieView {
  Rigid3d cam_from_body;
  const ceres::LossFunction* loss = nullptr;
};

// residual = W * unit ray of the point in the view; W * observed ray = 0.
struct TieSight {
  int point = 0;
  int pose = 0;  // unknown: world_from_body
  int view = 0;
  Eigen::Matrix<float, 2, 3> w = Eigen::Matrix<float, 2, 3>::Zero();
};

class BlockSolver {
 public:
  std::vector<Unknown> unknowns;
  std::vector<Factor> factors;
  std::vector<TiePoint> points;
  std::vector<TieView> views;
  std::vector<TieSight> sights;  // sorted by point

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

  // After Linearise, all at the present state. `open`: what nothing holds gets a sigma that says so; else NumericError.
  void Linearise(int threads, const CancelToken& cancel, bool open = false);
  // Of an unknown's first number among the equations; -1: not estimated. Each unknown has six, of which those it does
  // not need stand alone.
  int Offset(int unknown) const;
  int Equations() const { return 6 * slots_; }
  // A part of the covariance of all, within two unknowns that share an observation (or that the factor fills in).
  Eigen::MatrixXd Covariance(int row, int column, int rows, int columns) const;
  // Columns [first, first + count) of the whole of it.
  Eigen::MatrixXd CovarianceColumns(int first, int count) const;
  Eigen::MatrixXd SolveNormal(Eigen::MatrixXd right) const;  // covariance of all * right
  Matrix6d PoseCovariance(int unknown) const;                // zero for one that is held
  Eigen::VectorXd Residual(int factor) const;                // whitened, before the robust weight
  double Weight(int factor) const;                           // rho'
  Eigen::MatrixXd Absorbed(int factor) const;  // J Q J', weighted: the part of the unit covariance the fit takes
  Eigen::MatrixXd Jacobian(int factor) const;  // weighted; columns of its free unknowns in order
  // into += J' a, J as in Jacobian, at the rows of its unknowns.
  void AddTransposed(int factor, const Eigen::MatrixXd& a, Eigen::MatrixXd* into) const;

 private:
  struct Chunk;
  struct PointTerms;
  void Prepare();
  void EvaluateFactors(bool with_jacobians, int threads, const CancelToken& cancel);
  double Build(int threads, const CancelToken& cancel, double damping);
  double Cost(int threads, const CancelToken& cancel);
  bool TermsOf(size_t point, double damping, PointTerms* terms) const;
  // The place of the pair of slots a >= b among the normal equations' blocks.
  size_t PairIndex(int a, int b) const;

  std::vector<int> slot_;  // of an unknown: its six equations, -1: none
  int slots_ = 0;
  // Pairs of slots (a >= b) that share an observation, sorted by b, then a: those of b begin at first_pair_[b].
  std::vector<std::pair<int, int>> pairs_;
  std::vector<size_t> first_pair_;
  std::vector<Matrix6d> normal_;  // of each pair: rows of a, columns of b
  std::unique_ptr<BlockCholesky> cholesky_;
  Eigen::VectorXd gradient_;
  std::vector<size_t> first_sight_;  // of each point
  std::vector<size_t> residual_at_, jacobian_at_;
  std::vector<int> columns_;  // of each factor's jacobian
  std::vector<double> residuals_, jacobians_, weights_, costs_;
  BlockCholesky::Inverse inverse_;
};

}  // namespace trigpoint
