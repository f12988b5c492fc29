#include "calib/estimation/sparse_least_squares.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/base/error.h"
#include "calib/estimation/manifold.h"
#include "calib/estimation/sparse_system.h"

namespace trigpoint {
namespace {

constexpr double kEnough = 1e-4;  // squared distance to the minimum, in standard deviations
constexpr char kSingular[] = "the normal equations are singular: an unknown shares no observation with the others";

}  // namespace

class SparseLeastSquares::Model final : public SparseProblem {
 public:
  explicit Model(SparseLeastSquares* s) : s_(*s) {
    tangents.resize(static_cast<size_t>(s->blocks_));
    for (size_t u = 0; u < s->unknowns.size(); ++u) {
      if (s->block_[u] >= 0) tangents[static_cast<size_t>(s->block_[u])] = s->unknowns[u].Tangent();
    }
    first_observation.assign(s->points.size() + 1, 0);
    for (const PointObservation& o : s->observations) ++first_observation[static_cast<size_t>(o.point) + 1];
    for (size_t i = 1; i < first_observation.size(); ++i) first_observation[i] += first_observation[i - 1];
    least_diagonal = 1e-12;
  }

  int ObservationBlock(int observation) const override {
    return s_.block_[static_cast<size_t>(s_.observations[static_cast<size_t>(observation)].pose)];
  }
  int Factors() const override { return static_cast<int>(s_.factors.size()); }
  int FactorRows(int factor) const override { return Of(factor).cost->num_residuals(); }
  const ceres::LossFunction* FactorLoss(int factor) const override { return Of(factor).loss; }
  void AppendFactorBlocks(int factor, std::vector<int>* blocks) const override {
    for (int u : Of(factor).unknowns) blocks->push_back(s_.block_[static_cast<size_t>(u)]);
  }

  void EvaluatePoint(int point, bool with_jacobians, PointTerm* terms) const override {
    const auto j = static_cast<size_t>(point);
    for (int k = first_observation[j]; k < first_observation[j + 1]; ++k) {
      const PointObservation& o = s_.observations[static_cast<size_t>(k)];
      const View& view = s_.views[static_cast<size_t>(o.view)];
      const Rigid3d world_from_body = s_.Pose(o.pose);
      const Eigen::Matrix<double, 2, 3> w = o.w.cast<double>();
      const Eigen::Vector3d ray = Eigen::Vector3d(w.row(0)).cross(Eigen::Vector3d(w.row(1)));
      PointTerm& t = *terms++;
      t.block = s_.block_[static_cast<size_t>(o.pose)];
      t.loss = view.loss;
      const Eigen::Vector3d& y = s_.points[j];
      const Rigid3d body_from_world = world_from_body.Inverse();
      const bool seen = with_jacobians ? EvaluateBearing<true>(body_from_world, view.cam_from_body, w, ray, y, &t)
                                       : EvaluateBearing<false>(body_from_world, view.cam_from_body, w, ray, y, &t);
      t.state = seen ? PointTerm::State::kSeen : PointTerm::State::kBehind;
      if (!seen || !with_jacobians) continue;
      // By the left tangent of world_from_body.
      t.jp.leftCols<3>() = t.jy * Skew(y - world_from_body.translation);
      t.jp.rightCols<3>() = -t.jy;
    }
  }

  bool EvaluateFactor(int factor, double* residual, double* const* jacobians) const override {
    const Factor& f = Of(factor);
    const int rows = f.cost->num_residuals();
    // Reused: there are many small factors.
    thread_local std::vector<double> raw;
    thread_local std::vector<const double*> parameters;
    thread_local std::vector<double*> by_ambient;
    parameters.clear(), by_ambient.clear();
    raw.resize(static_cast<size_t>(rows) * 7 * f.unknowns.size());
    for (size_t k = 0; k < f.unknowns.size(); ++k) {
      parameters.push_back(s_.unknowns[static_cast<size_t>(f.unknowns[k])].value.data());
      by_ambient.push_back(jacobians[k] == nullptr ? nullptr : raw.data() + static_cast<size_t>(rows) * 7 * k);
    }
    if (!f.cost->Evaluate(parameters.data(), residual, by_ambient.data())) return false;
    for (size_t k = 0; k < f.unknowns.size(); ++k) {
      if (jacobians[k] == nullptr) continue;
      const Unknown& unknown = s_.unknowns[static_cast<size_t>(f.unknowns[k])];
      const Eigen::Map<const Eigen::MatrixXd> ambient(by_ambient[k], unknown.size, rows);  // transposed
      Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>> by_tangent(jacobians[k], 6, rows);
      if (unknown.size == 7) {
        Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
        Rigid3Manifold().PlusJacobian(unknown.value.data(), plus.data());
        by_tangent.noalias() = plus.transpose() * ambient;
      } else {
        by_tangent.topRows(unknown.size) = ambient;
      }
    }
    return true;
  }

  std::vector<Eigen::Vector3d>& PointPositions() override { return s_.points; }

  void Step(const Eigen::VectorXd& step) override {
    before_ = s_.unknowns;
    for (size_t u = 0; u < s_.unknowns.size(); ++u) {
      if (s_.block_[u] < 0) continue;
      Unknown& unknown = s_.unknowns[u];
      const Vector6d by = step.segment<6>(6 * s_.block_[u]);
      if (unknown.size == 7) {
        Rigid3ToBlock(s_.Pose(static_cast<int>(u)).Plus(by), unknown.value.data());
      } else {
        for (int k = 0; k < unknown.size; ++k) unknown.value[static_cast<size_t>(k)] += by[k];
      }
    }
  }
  void Undo() override { s_.unknowns = before_; }

 private:
  const Factor& Of(int factor) const { return s_.factors[static_cast<size_t>(factor)]; }
  SparseLeastSquares& s_;
  std::vector<Unknown> before_;
};

SparseLeastSquares::SparseLeastSquares() = default;
SparseLeastSquares::~SparseLeastSquares() = default;
SparseLeastSquares::SparseLeastSquares(SparseLeastSquares&&) noexcept = default;
SparseLeastSquares& SparseLeastSquares::operator=(SparseLeastSquares&&) noexcept = default;

int SparseLeastSquares::AddPose(const Rigid3d& pose) {
  Rigid3ToBlock(pose, unknowns.emplace_back().value.data());
  return static_cast<int>(unknowns.size()) - 1;
}

int SparseLeastSquares::AddNumbers(const std::vector<double>& values) {
  Unknown& u = unknowns.emplace_back();
  u.size = static_cast<int>(values.size());
  std::copy(values.begin(), values.end(), u.value.begin());
  return static_cast<int>(unknowns.size()) - 1;
}

int SparseLeastSquares::AddFactor(ceres::CostFunction* cost, const ceres::LossFunction* loss,
                                  const std::vector<int>& its_unknowns) {
  factors.push_back({std::unique_ptr<ceres::CostFunction>(cost), loss, its_unknowns});
  return static_cast<int>(factors.size()) - 1;
}

Rigid3d SparseLeastSquares::Pose(int unknown) const {
  return Rigid3FromBlock(unknowns[static_cast<size_t>(unknown)].value.data());
}

int SparseLeastSquares::Offset(int unknown) const {
  const int block = block_[static_cast<size_t>(unknown)];
  return block < 0 ? -1 : 6 * block;
}

void SparseLeastSquares::Prepare() {
  std::vector<bool> used(unknowns.size(), false);
  for (const Factor& f : factors) {
    for (int u : f.unknowns) used[static_cast<size_t>(u)] = true;
  }
  for (const PointObservation& o : observations) used[static_cast<size_t>(o.pose)] = true;
  block_.assign(unknowns.size(), -1);
  blocks_ = 0;
  for (size_t u = 0; u < unknowns.size(); ++u) {
    if (used[u] && !unknowns[u].constant) block_[u] = blocks_++;
  }
  system_ = std::make_unique<SparseSystem>(Model(this));
}

SparseLeastSquares::Summary SparseLeastSquares::Solve(int max_iterations, int threads, ProgressSink& progress,
                                                      const CancelToken& cancel) {
  Prepare();
  Model model(this);
  SparseOptions options;
  options.max_iterations = max_iterations;
  options.distance_tolerance = kEnough;
  const SparseSummary s = Minimise(&model, system_.get(), options, {threads, cancel}, progress);
  if (!std::isfinite(s.initial_cost)) throw NumericError("a residual is not finite at the start");
  if (s.singular) throw NumericError(kSingular);
  return {s.initial_cost, s.final_cost, s.iterations, s.converged};
}

void SparseLeastSquares::Linearise(int threads, const CancelToken& cancel, bool open) {
  if (!system_->Linearise(Model(this), open, {threads, cancel})) throw NumericError(kSingular);
  inverse_ = std::as_const(system_->matrix()).SelectedInverse(threads);
}

Eigen::MatrixXd SparseLeastSquares::Covariance(int row, int column, int rows, int columns) const {
  return inverse_.Block(row / 6, column / 6).block(row % 6, column % 6, rows, columns);
}

Eigen::MatrixXd SparseLeastSquares::SolveNormal(Eigen::MatrixXd right) const {
  for (Eigen::Index k = 0; k < right.cols(); ++k) system_->matrix().Solve(right.col(k));
  return right;
}

const Eigen::VectorXd& SparseLeastSquares::Gradient() const { return system_->gradient(); }

Eigen::MatrixXd SparseLeastSquares::CovarianceColumns(int first, int count) const {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(Equations(), count);
  for (int i = 0; i < count; ++i) right(first + i, i) = 1;
  return SolveNormal(std::move(right));
}

Matrix6d SparseLeastSquares::PoseCovariance(int unknown) const {
  const int block = block_[static_cast<size_t>(unknown)];
  return block < 0 ? Matrix6d(Matrix6d::Zero()) : inverse_.Block(block, block);
}

Eigen::VectorXd SparseLeastSquares::Residual(int factor) const { return system_->Factor(factor).residual; }

double SparseLeastSquares::Weight(int factor) const { return system_->Factor(factor).weight; }

Eigen::MatrixXd SparseLeastSquares::AdjustedCovariance(int factor) const {
  const SparseSystem::FactorTerms terms = system_->Factor(factor);
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(terms.residual.size(), terms.residual.size());
  for (const auto& [a, ja] : terms.jacobians) {
    for (const auto& [b, jb] : terms.jacobians) q.noalias() += ja.transpose() * (inverse_.Block(a, b) * jb);
  }
  return q;
}

void SparseLeastSquares::AddTransposed(int factor, const Eigen::MatrixXd& a, Eigen::MatrixXd* into) const {
  const SparseSystem::FactorTerms terms = system_->Factor(factor);
  for (const auto& [block, j] : terms.jacobians) {
    into->middleRows<6>(6 * block).noalias() += std::sqrt(terms.weight) * j * a;
  }
}

Eigen::MatrixXd SparseLeastSquares::Times(int factor, const Eigen::MatrixXd& x) const {
  const SparseSystem::FactorTerms terms = system_->Factor(factor);
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(terms.residual.size(), x.cols());
  for (const auto& [block, j] : terms.jacobians) product.noalias() += j.transpose() * x.middleRows<6>(6 * block);
  return std::sqrt(terms.weight) * product;
}

}  // namespace trigpoint
