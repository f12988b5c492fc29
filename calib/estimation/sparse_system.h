// The engine behind bundle adjustment (bundle.h), the tag map and reference trajectories (sparse_least_squares.h):
// normal equations of a sparse least squares problem with its points eliminated, Levenberg-Marquardt, and the
// covariance at the minimum.
//
//   minimise  1/2 sum rho(|r_f|^2)  +  1/2 sum rho(|r_k|^2)
//
// over factors r_f of any number of rows, which depend on blocks of at most six unknowns each (a pose, a scale), and
// observations r_k (2 rows), which depend on one block and on one point. All residuals are whitened. The result does
// not depend on the number of threads: every sum is made in an order of its own.
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/bearing_terms.h"
#include "calib/estimation/block_cholesky.h"

namespace trigpoint {

struct PointTerm : ObservationTerms {
  enum class State { kUnused, kBehind, kSeen };
  State state = State::kUnused;
  int block = -1;  // of the pose; below zero: it is held
  const ceres::LossFunction* loss = nullptr;
};

// A problem as the engine sees it. What is evaluated is evaluated at the present state, by several threads at a time.
class SparseProblem {
 public:
  virtual ~SparseProblem() = default;

  // Structure: set before a SparseSystem is made of it, and unchanged while that is used.
  std::vector<int> tangents;              // unknowns of each block, 1 to 6
  std::vector<int> first_observation{0};  // of each point, and behind the last one; observations are sorted by point
  bool points_constant = false;
  double least_diagonal = 0;  // of the normal equations, so that an unknown without information stays where it is

  int Blocks() const { return static_cast<int>(tangents.size()); }
  int Points() const { return static_cast<int>(first_observation.size()) - 1; }
  // Block of an observation that is in use; below zero: held or not in use.
  virtual int ObservationBlock(int observation) const = 0;
  virtual int Factors() const = 0;
  virtual int FactorRows(int factor) const = 0;
  // Appends the block of each unknown of a factor, below zero for one that is held.
  virtual void AppendFactorBlocks(int factor, std::vector<int>* blocks) const = 0;

  // All observations of a point, one term each.
  virtual void EvaluatePoint(int point, bool with_jacobians, PointTerm* terms) const = 0;
  virtual const ceres::LossFunction* FactorLoss(int factor) const = 0;
  // `jacobians`: of each unknown, null for one that is held or where none is wanted: the transposed derivative by its
  // tangent, 6 x rows, column by column; rows that the block has no unknowns for stay zero. False: not defined here.
  virtual bool EvaluateFactor(int factor, double* residual, double* const* jacobians) const = 0;

  virtual std::vector<Eigen::Vector3d>& PointPositions() = 0;
  // Where a point at `y` goes that the equations move by `by`, while a block that sees it makes a step. The equations
  // move it along a tangent; a pose that turns moves it along an arc, which lies apart from that far from the origin.
  virtual Eigen::Vector3d MovedAlong(int, const Vector6d&, const Eigen::Vector3d& y, const Eigen::Vector3d& by) const {
    return y + by;
  }
  // Moves the blocks, six elements of `step` each; Undo takes the last step back.
  virtual void Step(const Eigen::VectorXd& step) = 0;
  virtual void Undo() = 0;
};

struct Workers {
  int threads = 0;
  const CancelToken& cancel;
};

class SparseSystem {
 public:
  explicit SparseSystem(const SparseProblem& problem);

  // 1/2 sum rho at the present state; infinite where a factor is not defined.
  double Cost(const SparseProblem& problem, const Workers& workers);
  // Normal equations at the present state, `damping` relative to the points' diagonals.
  void Build(const SparseProblem& problem, double damping, const Workers& workers);
  // Factorises what was built; `damping` relative to the blocks' diagonals. False if it is not positive definite.
  bool Factorize(const SparseProblem& problem, double damping, const Workers& workers);
  // The factorisation without damping. What leaves the equations singular gets a variance of 1e9 if `open`.
  bool Linearise(const SparseProblem& problem, bool open, const Workers& workers);
  // The step that the factorised equations give, with the damping that they were built and factorised with.
  struct Step {
    Eigen::VectorXd blocks;               // six elements each
    std::vector<Eigen::Vector3d> points;  // by how much each moves, as the equations say; empty: none moves
    std::vector<int> carriers;            // the block that each moves along with (MovedAlong); below zero: none
    // With the gradient g, the equations H and the damping D: -g' step = step' (H + D) step, and step' D step. The
    // first is the squared distance to the minimum in standard deviations as far as damping adds little to it.
    double decrement = 0, by_damping = 0;
    // By how much the cost falls if it is as the equations describe it.
    double PredictedFall() const { return 0.5 * (decrement + by_damping); }
  };
  Step SolveStep(const SparseProblem& problem, double damping, const Workers& workers) const;

  const Eigen::VectorXd& gradient() const { return gradient_; }
  BlockCholesky& matrix() { return matrix_; }
  const BlockCholesky& matrix() const { return matrix_; }

  // A factor as last evaluated.
  struct FactorTerms {
    double weight;                               // rho'
    Eigen::Map<const Eigen::VectorXd> residual;  // whitened, before the weight
    std::vector<std::pair<int, Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>>> jacobians;  // free blocks
  };
  FactorTerms Factor(int factor) const;
  double EvaluateFactors(const SparseProblem& problem, bool with_jacobians, const Workers& workers);

 private:
  // Of each factor, and the end: where its unknowns' blocks, residuals and jacobians (6 x rows a free block) begin.
  struct FactorLayout {
    std::vector<int> blocks;
    std::vector<size_t> block{0}, residual{0}, jacobian{0};
    explicit FactorLayout(const SparseProblem& problem);
    size_t size() const { return block.size() - 1; }
  };
  // Which blocks of the lower triangle may not be zero, in the order in which BlockCholesky gets them; diagonals first.
  // Poses share points with their neighbours and, where a loop closes, with those of a few traversals: each row has
  // tables for the stretches that its columns lie in, none for what is between.
  class Pattern {
   public:
    Pattern(const SparseProblem& problem, const FactorLayout& factors);
    int Find(int row, int column) const;
    const std::vector<std::pair<int, int>>& blocks() const { return blocks_; }

   private:
    static constexpr size_t kStretch = 32;
    void Add(int row, int column);
    void AddAll(std::vector<int>* blocks);
    std::vector<std::vector<int>> table_of_;         // [row][(row - column) / kStretch], -1: nothing there
    std::vector<std::array<int, kStretch>> tables_;  // [(row - column) % kStretch]
    std::vector<std::pair<int, int>> blocks_;
  };
  // What an observation adds to the normal equations.
  struct Term {
    int block = -1;                       // -1: nothing
    Eigen::Matrix<double, 6, 2> jp;       // transposed, times the root of its weight
    Eigen::Matrix<double, 6, 3> mixed;    // pose with point
    Eigen::Matrix<double, 6, 3> reduced;  // the same times minus the inverse of the point's block
    Vector6d gradient;
  };

  void MovePoints(const SparseProblem& problem, double damping, const Workers& workers, Step* step) const;
  void BuildPoints(const SparseProblem& problem, double damping, const Workers& workers);
  void ReducePoint(const SparseProblem& problem, int point, double damping, std::vector<PointTerm>* buffer,
                   Term* terms) const;
  void AddPoint(bool constant, const Term* begin, const Term* end, int worker, int workers);
  void AddFactors(int worker, int workers);

  FactorLayout factors_;
  std::vector<double> residuals_, jacobians_, weights_, costs_;
  std::vector<std::pair<int, int>> chunks_;  // of points, [begin, end)
  Pattern pattern_;
  BlockCholesky matrix_;
  Eigen::VectorXd gradient_, diagonal_;  // of the blocks; the diagonal is that before damping
};

// A point's own 3 x 3 equations, robustly weighted; `terms` are scaled by the root of their weights.
struct PointEquations {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};
PointEquations LinearisePoint(const SparseProblem& problem, int point, std::vector<PointTerm>* terms);
double PointCost(const SparseProblem& problem, int point, std::vector<PointTerm>* terms);
// With relative damping. A part of the trace keeps points without parallax (rank 2) solvable: they do not move along
// their ray.
Eigen::Matrix3d Damped(const Eigen::Matrix3d& hessian, double damping);

struct SparseOptions {
  int max_iterations = 30;
  double relative_cost_tolerance = 1e-9;  // ends when the cost falls by less than this part of itself
  double distance_tolerance = 0;          // ends when the squared distance to the minimum (standard deviations) is less
  double damping = 1e-4;                  // at the start
};

struct SparseSummary {
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;
  bool converged = false;
  bool singular = false;  // no step could be computed at all, or the cost is not finite at the start
};

// Levenberg-Marquardt.
SparseSummary Minimise(SparseProblem* problem, SparseSystem* system, const SparseOptions& options,
                       const Workers& workers, ProgressSink& progress);

}  // namespace trigpoint
