#include "eval/truth/chain_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "calib/base/error.h"
#include "calib/estimation/loss.h"
#include "calib/estimation/sparse_least_squares.h"
#include "survey/tags/survey_costs.h"

namespace trigpoint {
namespace {

// Poses near known ones, whose errors are correlated: r = L^-1 [x_i - known_i], left tangents, L L' their covariance.
class JointPosePriorCost final : public ceres::CostFunction {
 public:
  JointPosePriorCost(std::vector<Rigid3d> known, const Eigen::MatrixXd& covariance) : known_(std::move(known)) {
    const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
    if (llt.info() != Eigen::Success) {
      throw NumericError("the tag map's covariance is not positive definite; survey again");
    }
    sqrt_info_ = llt.matrixL().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
    set_num_residuals(static_cast<int>(covariance.rows()));
    mutable_parameter_block_sizes()->assign(known_.size(), 7);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>;
    Eigen::VectorXd difference(num_residuals());
    for (size_t i = 0; i < known_.size(); ++i) {
      const auto at = 6 * static_cast<Eigen::Index>(i);
      difference.segment<6>(at) = Rigid3FromBlock(parameters[i]).Minus(known_[i]);
      if (jacobians == nullptr || jacobians[i] == nullptr) continue;
      Matrix6d j = Matrix6d::Identity();
      j.topLeftCorner<3, 3>() = LeftJacobianInverseSO3(difference.segment<3>(at));
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      Rigid3Manifold().MinusJacobian(parameters[i], minus.data());
      Eigen::Map<RowMajor>(jacobians[i], num_residuals(), 7) = sqrt_info_.middleCols<6>(at) * (j * minus);
    }
    Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = sqrt_info_.triangularView<Eigen::Lower>() * difference;
    return true;
  }

 private:
  std::vector<Rigid3d> known_;
  Eigen::MatrixXd sqrt_info_;
};

class Solver {
 public:
  Solver(ChainProblem* problem, const ChainOptions& options, const CancelToken& cancel)
      : p_(*problem),
        options_(options),
        cancel_(cancel),
        huber_(options.gate_chi2),
        returned_(problem->observations.size(), false) {
    for (size_t i = 0; i < p_.bodies.size(); ++i) {
      solver_.AddPose(p_.bodies[i]);
      solver_.unknowns.back().constant = !p_.free[i];
    }
    first_tag_ = static_cast<int>(p_.bodies.size());
    for (const Rigid3d& tag : p_.tags) solver_.AddPose(tag);
    scale_ = solver_.AddNumbers({p_.scale});
    const int zero = solver_.AddNumbers({0});  // no drift of the heading, no shift of the corners
    solver_.unknowns.back().constant = true;
    for (const ChainObservation& o : p_.observations) {
      solver_.AddFactor(new TagCost(o.sight, o.size_m, o.cam_from_body, &p_.corner_factor), nullptr,
                        {o.body, first_tag_ + o.tag, zero});
    }
    for (const ChainMotion& m : p_.motions) {
      if (!p_.free[static_cast<size_t>(m.a)] || !p_.free[static_cast<size_t>(m.b)]) continue;
      Vector6d sigma;
      sigma << Eigen::Vector3d::Constant(m.sigma_rot_rad), Eigen::Vector3d::Constant(m.sigma_m);
      solver_.AddFactor(new OdometryCost(m.a_from_b, Eigen::Vector3d::Zero(), sigma, motion_factor_.data()), nullptr,
                        {m.a, m.b, scale_, zero});
    }
    motion_end_ = static_cast<int>(solver_.factors.size());
    solver_.AddFactor(new NumberCost(1, p_.scale_sigma), nullptr, {scale_});
    AddTagPrior();
  }

  int Iterate(bool robust) {
    SetFactors(robust);
    ProgressSink silent;
    const SparseLeastSquares::Summary summary = solver_.Solve(options_.max_iterations, 1, silent, cancel_);
    cost_ = 2 * summary.cost_after;
    for (size_t i = 0; i < p_.bodies.size(); ++i) p_.bodies[i] = solver_.Pose(static_cast<int>(i));
    for (size_t i = 0; i < p_.tags.size(); ++i) p_.tags[i] = solver_.Pose(first_tag_ + static_cast<int>(i));
    p_.scale = solver_.unknowns[static_cast<size_t>(scale_)].value[0];
    return summary.iterations;
  }

  // Least squares without a robust loss; a body whose observations were all rejected stays in the equations.
  void Linearise() {
    SetFactors(false);
    solver_.Linearise(1, cancel_, true);
  }

  // Data snooping by standardised residuals. An observation that is wrong pulls its neighbours along the chain with it,
  // so that of those nearby only the worst is rejected at a time; one that was rejected and agrees with the solution
  // made without it comes back. True if anything changed.
  bool Snoop() {
    constexpr int kNearby = 20;  // bodies
    constexpr double kMuchWorse = 4;
    bool changed = false;
    std::vector<std::pair<double, size_t>> bad;
    for (size_t i = 0; i < p_.observations.size(); ++i) {
      ChainObservation& o = p_.observations[i];
      if (!p_.free[static_cast<size_t>(o.body)]) continue;
      const int factor = static_cast<int>(i);
      const Eigen::VectorXd r = solver_.Residual(factor);
      // Covariance of the residual: 1 - J C J', never below a tenth of the stated noise; 1 + J C J' of one left out.
      const Eigen::MatrixXd q = (o.rejected ? 1 : 1.1) * Eigen::MatrixXd::Identity(r.size(), r.size()) +
                                (o.rejected ? 1 : -1) * solver_.AdjustedCovariance(factor);
      const double chi2 = r.dot(q.ldlt().solve(r));
      if (o.rejected) {
        if (chi2 > options_.gate_chi2 || returned_[i]) continue;
        o.rejected = false;
        returned_[i] = changed = true;
      } else if (chi2 > options_.gate_chi2) {
        bad.emplace_back(chi2, i);
      }
    }
    std::sort(bad.begin(), bad.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<std::pair<double, int>> worse;  // rejected now, with their bodies
    for (const auto& [chi2, i] : bad) {
      ChainObservation& o = p_.observations[i];
      const bool overshadowed = std::any_of(worse.begin(), worse.end(), [&, chi2 = chi2](const auto& w) {
        return std::abs(w.second - o.body) <= kNearby && w.first > kMuchWorse * chi2;
      });
      if (overshadowed) continue;
      o.rejected = changed = true;
      worse.emplace_back(chi2, o.body);
    }
    return changed;
  }

  // One round of variance components; true if a factor changed by more than one percent.
  bool UpdateFactors() {
    double square[3] = {0, 0, 0}, redundancy[3] = {0, 0, 0};
    for (size_t i = 0; i < p_.observations.size(); ++i) {
      if (p_.observations[i].rejected) continue;
      const double chi2 = solver_.Residual(static_cast<int>(i)).squaredNorm();
      double rho[3];
      huber_.Evaluate(chi2, rho);
      square[0] += rho[1] * chi2;  // the loss keeps gross errors out of the noise
      redundancy[0] += 8 - solver_.AdjustedCovariance(static_cast<int>(i)).trace();
    }
    for (int i = static_cast<int>(p_.observations.size()); i < motion_end_; ++i) {
      const Eigen::VectorXd r = solver_.Residual(i);
      const Eigen::VectorXd taken = solver_.AdjustedCovariance(i).diagonal();
      square[1] += r.head<3>().squaredNorm();
      square[2] += r.tail<3>().squaredNorm();
      redundancy[1] += 3 - taken.head<3>().sum();
      redundancy[2] += 3 - taken.tail<3>().sum();
    }
    double* const factors[3] = {&p_.corner_factor, &p_.motion_rot_factor, &p_.motion_m_factor};
    bool changed = false;
    for (int k = 0; k < 3; ++k) {
      if (redundancy[k] < 10) continue;  // too few redundant observations for a factor
      const double before = *factors[k];
      *factors[k] *= std::clamp(std::sqrt(square[k] / redundancy[k]), 0.1, 10.0);
      if (k == 0) *factors[k] = std::max(1.0, *factors[k]);
      changed |= std::abs(*factors[k] / before - 1) > 0.01;
    }
    return changed;
  }

  void Finish(ChainSolution* solution) {
    for (size_t i = 0; i < p_.observations.size(); ++i) {
      ChainObservation& o = p_.observations[i];
      o.rms_px = ResidualPx(o.sight, solver_.Residual(static_cast<int>(i)) * p_.corner_factor);
    }
    for (size_t i = 0; i < p_.bodies.size(); ++i) {
      solution->body_covariance.push_back(solver_.PoseCovariance(static_cast<int>(i)));
    }
    const int at = solver_.Offset(scale_);
    solution->scale_sigma = std::sqrt(solver_.Covariance(at, at, 1, 1)(0, 0));
    solution->cost = cost_;
  }

 private:
  // Tags whose errors are correlated share a factor.
  void AddTagPrior() {
    const auto n = static_cast<Eigen::Index>(p_.tags.size());
    Eigen::MatrixXd between = p_.tag_covariance;
    for (Eigen::Index i = 0; i < n; ++i) between.block<6, 6>(6 * i, 6 * i).setZero();
    if (!between.isZero(0)) {
      std::vector<int> tags;
      for (int i = 0; i < n; ++i) tags.push_back(first_tag_ + i);
      solver_.AddFactor(new JointPosePriorCost(p_.tags, p_.tag_covariance), nullptr, tags);
      return;
    }
    for (int i = 0; i < n; ++i) {
      solver_.AddFactor(
          new JointPosePriorCost({p_.tags[static_cast<size_t>(i)]}, p_.tag_covariance.block<6, 6>(6 * i, 6 * i)),
          nullptr, {first_tag_ + i});
    }
  }

  void SetFactors(bool robust) {
    motion_factor_.head<3>().setConstant(p_.motion_rot_factor);
    motion_factor_.tail<3>().setConstant(p_.motion_m_factor);
    for (size_t i = 0; i < p_.observations.size(); ++i) {
      // A rejected one keeps its place among the equations, so that its covariance there can be asked for.
      const ceres::LossFunction* const used = robust ? &huber_ : nullptr;
      solver_.factors[i].loss = p_.observations[i].rejected ? &nothing_ : used;
    }
  }

  ChainProblem& p_;
  const ChainOptions& options_;
  const CancelToken& cancel_;
  const HuberChi2Loss huber_;  // at the gate, of a whole observation
  const ceres::ScaledLoss nothing_{nullptr, 0, ceres::TAKE_OWNERSHIP};
  std::vector<bool> returned_;  // observations that were rejected and came back
  SparseLeastSquares solver_;   // unknowns: bodies, tags, scale; factors: observations, motions, priors
  int first_tag_ = 0, scale_ = 0, motion_end_ = 0;
  Vector6d motion_factor_ = Vector6d::Ones();
  double cost_ = 0;
};

}  // namespace

ChainSolution SolveChain(ChainProblem* problem, const ChainOptions& options, ProgressSink& progress,
                         const CancelToken& cancel) {
  progress.Begin("poses from the tag map", options.variance_rounds + 2);
  Solver solver(problem, options, cancel);
  ChainSolution solution;
  solution.iterations = solver.Iterate(true);
  progress.Advance(1);
  // Factors first, so that a run whose motion is noisier than stated does not cost good observations. Rounds that
  // reject come on top.
  constexpr int kMaxRounds = 40;
  for (int round = 0, clean = 0; round < kMaxRounds && clean <= options.variance_rounds; ++round) {
    cancel.ThrowIfCancelled();
    solver.Linearise();
    const bool changed = clean < options.variance_rounds && solver.UpdateFactors();
    if (changed) solver.Linearise();
    const bool rejected = solver.Snoop();
    solution.iterations += solver.Iterate(rejected);
    if (!rejected) ++clean, progress.Advance(1);
    if (!changed && !rejected) break;
  }
  solver.Linearise();
  solver.Finish(&solution);
  return solution;
}

}  // namespace trigpoint
