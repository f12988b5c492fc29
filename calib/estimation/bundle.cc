#include "calib/estimation/bundle.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/sparse_system.h"

namespace trigpoint {
namespace {

// A bundle problem as the engine sees it: a block for each free pose, then one for each free scale; factors are the
// problem's own, then the map, then the prior of each free scale.
class BundleModel final : public SparseProblem {
 public:
  // `moving`: the same problem, if it is to be solved.
  explicit BundleModel(const BundleProblem& p, BundleProblem* moving = nullptr) : p_(p), moving_(moving) {
    points_constant = p.points_constant;
    first_observation.assign(p.points.size() + 1, 0);
    for (const BearingObservation& o : p.observations) ++first_observation[static_cast<size_t>(o.point) + 1];
    for (size_t i = 1; i < first_observation.size(); ++i) first_observation[i] += first_observation[i - 1];
    for (size_t i = 0; i < p.poses.size(); ++i) {
      const bool constant = !p.pose_constant.empty() && p.pose_constant[i];
      block_.push_back(constant ? -1 : static_cast<int>(tangents.size()));
      if (constant) continue;
      pose_of_.push_back(i);
      tangents.push_back(6);
    }
    for (size_t s = 0; s < p.scales.size(); ++s) {
      const bool constant = p.scales[s].constant;
      scale_block_.push_back(constant ? -1 : static_cast<int>(tangents.size()));
      if (constant) continue;
      tangents.push_back(1);
      free_scales_.push_back(s);
    }
  }

  int BlockOf(int pose) const { return pose < 0 ? -1 : block_[static_cast<size_t>(pose)]; }
  size_t PoseCount() const { return block_.size(); }
  int ScaleBlockOf(int scale) const { return scale < 0 ? -1 : scale_block_[static_cast<size_t>(scale)]; }

  int ObservationBlock(int observation) const override {
    const BearingObservation& o = p_.observations[static_cast<size_t>(observation)];
    return o.active ? BlockOf(o.pose) : -1;
  }

  void EvaluatePoint(int point, bool with_jacobians, PointTerm* terms) const override {
    const auto j = static_cast<size_t>(point);
    for (int k = first_observation[j]; k < first_observation[j + 1]; ++k) {
      const BearingObservation& o = p_.observations[static_cast<size_t>(k)];
      PointTerm& t = *terms++;
      t.state = PointTerm::State::kUnused;
      if (!o.active) continue;
      t.block = BlockOf(o.pose);
      t.loss = p_.loss.get();
      const bool seen =
          with_jacobians ? Evaluate<true>(p_, o, p_.points[j], &t) : Evaluate<false>(p_, o, p_.points[j], &t);
      t.state = seen ? PointTerm::State::kSeen : PointTerm::State::kBehind;
    }
  }

  int Factors() const override { return static_cast<int>(p_.factors.size() + (p_.map ? 1 : 0) + free_scales_.size()); }

  int FactorRows(int factor) const override {
    if (IsPoseFactor(factor)) return 6;
    return IsMap(factor) ? 6 * static_cast<int>(p_.map->rigs.size()) : 1;
  }

  void AppendFactorBlocks(int factor, std::vector<int>* blocks) const override {
    if (IsPoseFactor(factor)) {
      const PoseFactor& f = p_.factors[static_cast<size_t>(factor)];
      blocks->insert(blocks->end(), {BlockOf(f.a), BlockOf(f.b), ScaleBlockOf(f.scale)});
    } else if (IsMap(factor)) {
      for (int rig : p_.map->rigs) blocks->push_back(BlockOf(rig));
      blocks->push_back(BlockOf(p_.map->frame));
    } else {
      blocks->push_back(scale_block_[ScaleOfPrior(factor)]);
    }
  }

  const ceres::LossFunction* FactorLoss(int factor) const override {
    return IsPoseFactor(factor) ? p_.factors[static_cast<size_t>(factor)].loss.get() : nullptr;
  }

  bool EvaluateFactor(int factor, double* residual, double* const* jacobians) const override {
    using Transposed = Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>>;
    if (IsPoseFactor(factor)) {
      FactorTerms t;
      trigpoint::EvaluateFactor(p_, p_.factors[static_cast<size_t>(factor)], &t);
      Eigen::Map<Vector6d>{residual} = t.r;
      if (jacobians[0] != nullptr) Transposed(jacobians[0], 6, 6) = t.ja.transpose();
      if (jacobians[1] != nullptr) Transposed(jacobians[1], 6, 6) = t.jb.transpose();
      if (jacobians[2] != nullptr) Transposed(jacobians[2], 6, 6).row(0) = t.js.transpose();
    } else if (IsMap(factor)) {
      const MapTerms t = EvaluateMap(p_, *p_.map);
      Eigen::Map<Eigen::VectorXd>(residual, t.r.size()) = t.r;
      for (Eigen::Index i = 0; 6 * i < t.j.cols(); ++i) {
        if (jacobians[i] != nullptr) Transposed(jacobians[i], 6, t.r.size()) = t.j.middleCols<6>(6 * i).transpose();
      }
    } else {
      const OdometryScale& scale = p_.scales[ScaleOfPrior(factor)];
      residual[0] = (scale.value - scale.prior) / scale.sigma;
      if (jacobians[0] != nullptr) jacobians[0][0] = 1 / scale.sigma;
    }
    return true;
  }

  std::vector<Eigen::Vector3d>& PointPositions() override { return moving_->points; }

  Eigen::Vector3d MovedAlong(int block, const Vector6d& step, const Eigen::Vector3d& y,
                             const Eigen::Vector3d& by) const override {
    const Rigid3d& pose = p_.poses[pose_of_[static_cast<size_t>(block)]];
    const Eigen::Vector3d turned = pose.rotation * y;
    const Eigen::Vector3d along = -(pose.rotation.conjugate() * (step.head<3>().cross(turned) + step.tail<3>()));
    return pose.Plus(step).Inverse() * (pose * (y + by - along));
  }

  void Step(const Eigen::VectorXd& step) override {
    old_poses_ = moving_->poses;
    old_scales_ = moving_->scales;
    for (size_t i = 0; i < block_.size(); ++i) {
      if (block_[i] >= 0) moving_->poses[i] = moving_->poses[i].Plus(step.segment<6>(6 * block_[i]));
    }
    for (size_t s : free_scales_) moving_->scales[s].value += step(6 * scale_block_[s]);
  }

  void Undo() override {
    moving_->poses = old_poses_;
    moving_->scales = old_scales_;
  }

 private:
  bool IsPoseFactor(int factor) const { return factor < static_cast<int>(p_.factors.size()); }
  bool IsMap(int factor) const { return p_.map && factor == static_cast<int>(p_.factors.size()); }
  size_t ScaleOfPrior(int factor) const {
    return free_scales_[static_cast<size_t>(factor) - p_.factors.size() - (p_.map ? 1 : 0)];
  }

  const BundleProblem& p_;
  BundleProblem* moving_;
  std::vector<int> block_, scale_block_;  // of each pose and scale, -1: held
  std::vector<size_t> pose_of_;           // of each block that is one's
  std::vector<size_t> free_scales_;
  std::vector<Rigid3d> old_poses_;
  std::vector<OdometryScale> old_scales_;
};

// One point with the poses held; stays where it is if it has no finite answer.
void OptimizePoint(const BundleModel& model, int point, int iterations, std::vector<PointTerm>* terms,
                   Eigen::Vector3d* y) {
  if (!y->allFinite()) return;
  double cost = PointCost(model, point, terms), damping = 1e-4;
  for (int it = 0; it < iterations; ++it) {
    const PointEquations e = LinearisePoint(model, point, terms);
    const Eigen::Vector3d step = -Damped(e.hessian, damping).ldlt().solve(e.gradient);
    if (!step.allFinite()) return;
    const Eigen::Vector3d before = *y;
    *y += step;
    const double next = PointCost(model, point, terms);
    if (next <= cost) {
      if (cost - next < 1e-8 * cost + 1e-12) return;
      cost = next;
      damping = std::max(1e-10, damping * 0.2);
    } else {
      *y = before;
      damping *= 10;
    }
  }
}

}  // namespace

double SquaredError(const BundleProblem& problem, const BearingObservation& o) {
  ObservationTerms t;
  if (!Evaluate<false>(problem, o, problem.points[static_cast<size_t>(o.point)], &t)) {
    return std::numeric_limits<double>::infinity();
  }
  return t.r.squaredNorm();
}

void OptimizePoints(BundleProblem& p, int iterations, int threads, const CancelToken& cancel) {
  constexpr int64_t kAtATime = 256;  // points
  const BundleModel model(p);
  const auto count = static_cast<int64_t>(p.points.size());
  ParallelFor((count + kAtATime - 1) / kAtATime, threads, cancel, [&](int64_t batch) {
    std::vector<PointTerm> terms;
    for (int64_t j = batch * kAtATime; j < std::min(count, (batch + 1) * kAtATime); ++j) {
      OptimizePoint(model, static_cast<int>(j), iterations, &terms, &p.points[static_cast<size_t>(j)]);
    }
  });
}

BundleSummary SolveBundle(BundleProblem& p, const BundleOptions& options, ProgressSink& progress,
                          const CancelToken& cancel) {
  BundleModel model(p, &p);
  if (model.Blocks() == 0) return {};
  SparseSystem system(model);
  const Workers workers{options.threads, cancel};
  progress.Begin("bundle adjustment", options.max_iterations);
  const SparseSummary s = Minimise(
      &model, &system, {options.max_iterations, options.relative_cost_tolerance, options.distance_tolerance, 1e-5},
      workers, progress);
  if (s.singular) {
    throw NumericError(
        "bundle adjustment: the normal equations are singular: the data do not determine every pose, point and scale");
  }
  // Leave the factors' final weights for those who report which evidence was believed.
  system.EvaluateFactors(model, false, workers);
  for (size_t i = 0; i < p.factors.size(); ++i) p.factors[i].weight = system.Factor(static_cast<int>(i)).weight;
  return {s.initial_cost, s.final_cost, s.iterations, s.converged};
}

struct BundleCovariance::Impl {
  BundleModel model;
  SparseSystem system;
  Workers workers;
  Eigen::MatrixXd shifts;  // 6 rows a pose: by the errors that observations share
  Impl(const BundleProblem& p, int threads, const CancelToken& cancel)
      : model(p),
        system(model),
        workers{threads, cancel},
        shifts(Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), p.pose_shifts.cols())) {
    shifts.topRows(p.pose_shifts.rows()) = p.pose_shifts;
  }
  auto ShiftsOf(int pose) const { return shifts.middleRows<6>(6 * static_cast<Eigen::Index>(pose)); }
};

BundleCovariance::BundleCovariance(const BundleProblem& problem, int threads, const CancelToken& cancel)
    : impl_(std::make_unique<Impl>(problem, threads, cancel)) {
  if (!impl_->system.Linearise(impl_->model, false, impl_->workers)) {
    throw NumericError(
        "covariance: the normal equations are singular: the data do not determine every pose, point and scale");
  }
}

BundleCovariance::~BundleCovariance() = default;

Eigen::VectorXd BundleCovariance::Gradient() const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(impl_->shifts.rows());
  for (size_t p = 0; p < impl_->model.PoseCount(); ++p) {
    const int block = impl_->model.BlockOf(static_cast<int>(p));
    if (block >= 0) out.segment<6>(6 * static_cast<Eigen::Index>(p)) = impl_->system.gradient().segment<6>(6 * block);
  }
  return out;
}

double BundleCovariance::ScaleVariance(int scale) const {
  const int block = impl_->model.ScaleBlockOf(scale);
  if (block < 0) return 0;
  Eigen::VectorXd x = Eigen::VectorXd::Unit(impl_->system.gradient().size(), 6 * block);
  impl_->system.matrix().Solve(x);
  return x(6 * block);
}

Eigen::MatrixXd BundleCovariance::Joint(const std::vector<int>& poses) const {
  const auto block = [&](size_t i) { return impl_->model.BlockOf(poses[i]); };
  const Eigen::Index n = 6 * static_cast<Eigen::Index>(poses.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  ParallelFor(n, impl_->workers.threads, impl_->workers.cancel, [&](int64_t column) {
    const int own = block(static_cast<size_t>(column / 6));
    if (own < 0) return;
    Eigen::VectorXd x = Eigen::VectorXd::Unit(impl_->system.gradient().size(), 6 * own + column % 6);
    impl_->system.matrix().Solve(x);
    for (size_t i = 0; i < poses.size(); ++i) {
      if (block(i) >= 0) out.block<6, 1>(6 * static_cast<Eigen::Index>(i), column) = x.segment<6>(6 * block(i));
    }
  });
  Eigen::MatrixXd shifts(n, impl_->shifts.cols());
  for (size_t i = 0; i < poses.size(); ++i) {
    shifts.middleRows<6>(6 * static_cast<Eigen::Index>(i)) = impl_->ShiftsOf(poses[i]);
  }
  return out + shifts * shifts.transpose();
}

Eigen::MatrixXd BundleCovariance::Times(const Eigen::MatrixXd& b) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(b.rows(), b.cols());
  const Eigen::Index poses = b.rows() / 6;
  ParallelFor(b.cols(), impl_->workers.threads, impl_->workers.cancel, [&](int64_t column) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(impl_->system.gradient().size());
    for (Eigen::Index p = 0; p < poses; ++p) {
      const int block = impl_->model.BlockOf(static_cast<int>(p));
      if (block >= 0) x.segment<6>(6 * block) = b.block<6, 1>(6 * p, column);
    }
    impl_->system.matrix().Solve(x);
    for (Eigen::Index p = 0; p < poses; ++p) {
      const int block = impl_->model.BlockOf(static_cast<int>(p));
      if (block >= 0) out.block<6, 1>(6 * p, column) = x.segment<6>(6 * block);
    }
  });
  return out + impl_->shifts * (impl_->shifts.transpose() * b);
}

void BundleCovariance::PoseBlocks(const std::vector<int>& next, std::vector<Matrix6d>* diagonal,
                                  std::vector<Matrix6d>* with_next) && {
  const BundleModel& model = impl_->model;
  const BlockCholesky::Inverse inverse = std::move(impl_->system.matrix()).SelectedInverse(impl_->workers.threads);
  const size_t poses = model.PoseCount();
  diagonal->assign(poses, Matrix6d::Zero());
  with_next->assign(poses, Matrix6d::Zero());
  for (size_t p = 0; p < poses; ++p) {
    const int block = model.BlockOf(static_cast<int>(p));
    if (block < 0) continue;
    const auto shifts = impl_->ShiftsOf(static_cast<int>(p));
    (*diagonal)[p] = inverse.Block(block, block) + shifts * shifts.transpose();
    const int after = p < next.size() ? model.BlockOf(next[p]) : -1;
    if (after >= 0) (*with_next)[p] = inverse.Block(block, after) + shifts * impl_->ShiftsOf(next[p]).transpose();
  }
}

}  // namespace trigpoint
