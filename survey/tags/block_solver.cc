#include "survey/tags/block_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "calib/base/error.h"
#include "calib/base/grid.h"
#include "calib/base/parallel.h"
#include "calib/estimation/manifold.h"

namespace trigpoint {
namespace {

constexpr int kChunks = 8;                // fixed, so that sums do not depend on threads
constexpr int64_t kFactorBatch = 256;     // factors evaluated at a time
constexpr double kEnoughDecrease = 1e-4;  // squared distance to the minimum, in standard deviations

using Matrix63d = Eigen::Matrix<double, 6, 3>;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

// W u and its derivatives by the point and by the body's left tangent.
Eigen::Vector2d TieResidual(const TieSight& sight, const TieView& view, const Rigid3d& world_from_body,
                            const Eigen::Vector3d& point, Matrix23d* by_point, Eigen::Matrix<double, 2, 6>* by_body,
                            bool* in_front) {
  const Eigen::Vector3d d = point - world_from_body.translation;
  const Eigen::Matrix3d cam_from_world =
      (view.cam_from_body.rotation * world_from_body.rotation.conjugate()).toRotationMatrix();
  const Eigen::Vector3d p = cam_from_world * d + view.cam_from_body.translation;
  const double distance = std::max(p.norm(), 1e-12);
  const Eigen::Vector3d ray = p / distance;
  const Matrix23d w = sight.w.cast<double>();
  // The observed ray spans the null space of W.
  *in_front = ray.dot(Eigen::Vector3d(w.row(0)).cross(Eigen::Vector3d(w.row(1)))) > 0;
  if (by_point != nullptr) {
    *by_point = w * (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / distance * cam_from_world;
    by_body->leftCols<3>() = *by_point * Skew(d);
    by_body->rightCols<3>() = -*by_point;
  }
  return w * ray;
}

}  // namespace

struct BlockSolver::PointTerms {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0;
  std::vector<int> slots;  // ascending, each once
  std::vector<Matrix6d> own;
  std::vector<Matrix63d> mixed;
  std::vector<Vector6d> own_gradient;
};

struct BlockSolver::Chunk {
  std::vector<Matrix6d> normal;
  Eigen::VectorXd gradient;
  double cost = 0;
};

int BlockSolver::AddPose(const Rigid3d& pose) {
  Unknown u;
  Rigid3ToBlock(pose, u.value.data());
  unknowns.push_back(u);
  return static_cast<int>(unknowns.size()) - 1;
}

int BlockSolver::AddNumbers(const std::vector<double>& values) {
  Unknown u;
  u.size = static_cast<int>(values.size());
  std::copy(values.begin(), values.end(), u.value.begin());
  unknowns.push_back(u);
  return static_cast<int>(unknowns.size()) - 1;
}

int BlockSolver::AddFactor(ceres::CostFunction* cost, const ceres::LossFunction* loss,
                           const std::vector<int>& its_unknowns) {
  factors.push_back({std::unique_ptr<ceres::CostFunction>(cost), loss, its_unknowns});
  return static_cast<int>(factors.size()) - 1;
}

Rigid3d BlockSolver::Pose(int unknown) const {
  return Rigid3FromBlock(unknowns[static_cast<size_t>(unknown)].value.data());
}

int BlockSolver::Offset(int unknown) const {
  const int slot = slot_[static_cast<size_t>(unknown)];
  return slot < 0 ? -1 : 6 * slot;
}

size_t BlockSolver::PairIndex(int a, int b) const {
  const auto begin = pairs_.begin() + static_cast<std::ptrdiff_t>(first_pair_[static_cast<size_t>(b)]);
  const auto end = pairs_.begin() + static_cast<std::ptrdiff_t>(first_pair_[static_cast<size_t>(b) + 1]);
  const auto at = std::lower_bound(begin, end, a, [](const std::pair<int, int>& p, int row) { return p.first < row; });
  return static_cast<size_t>(at - pairs_.begin());
}

void BlockSolver::Prepare() {
  std::vector<bool> used(unknowns.size(), false);
  for (const Factor& f : factors) {
    for (int u : f.unknowns) used[static_cast<size_t>(u)] = true;
  }
  for (const TieSight& s : sights) used[static_cast<size_t>(s.pose)] = true;
  slot_.assign(unknowns.size(), -1);
  slots_ = 0;
  for (size_t u = 0; u < unknowns.size(); ++u) {
    if (used[u] && !unknowns[u].constant) slot_[u] = slots_++;
  }
  first_sight_.assign(points.size() + 1, 0);
  for (const TieSight& s : sights) ++first_sight_[static_cast<size_t>(s.point) + 1];
  for (size_t i = 1; i < first_sight_.size(); ++i) first_sight_[i] += first_sight_[i - 1];

  pairs_.clear();
  const auto couple = [&](int a, int b) {
    if (a >= 0 && b >= 0) pairs_.emplace_back(std::max(a, b), std::min(a, b));
  };
  for (int s = 0; s < slots_; ++s) couple(s, s);
  for (const Factor& f : factors) {
    for (size_t i = 0; i < f.unknowns.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        couple(slot_[static_cast<size_t>(f.unknowns[i])], slot_[static_cast<size_t>(f.unknowns[j])]);
      }
    }
  }
  if (!points.empty()) {
    // Pairs come many times over: a bit each first.
    const auto n = static_cast<size_t>(slots_);
    std::vector<bool> shared(n * n, false);
    for (size_t p = 0; p < points.size(); ++p) {
      for (size_t i = first_sight_[p]; i < first_sight_[p + 1]; ++i) {
        for (size_t j = first_sight_[p]; j < i; ++j) {
          const int a = slot_[static_cast<size_t>(sights[i].pose)], b = slot_[static_cast<size_t>(sights[j].pose)];
          if (a >= 0 && b >= 0)
            shared[static_cast<size_t>(std::min(a, b)) * n + static_cast<size_t>(std::max(a, b))] = true;
        }
      }
    }
    for (size_t b = 0; b < n; ++b) {
      for (size_t a = b + 1; a < n; ++a) {
        if (shared[b * n + a]) couple(static_cast<int>(a), static_cast<int>(b));
      }
    }
  }
  std::sort(pairs_.begin(), pairs_.end(),
            [](const auto& p, const auto& q) { return std::tie(p.second, p.first) < std::tie(q.second, q.first); });
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  first_pair_.assign(static_cast<size_t>(slots_) + 1, 0);
  for (const auto& [a, b] : pairs_) ++first_pair_[static_cast<size_t>(b) + 1];
  for (size_t b = 1; b < first_pair_.size(); ++b) first_pair_[b] += first_pair_[b - 1];
  normal_.assign(pairs_.size(), Matrix6d::Zero());
  cholesky_ = std::make_unique<BlockCholesky>(slots_, pairs_);

  residual_at_.clear(), jacobian_at_.clear(), columns_.clear();
  size_t r = 0, j = 0;
  for (const Factor& f : factors) {
    residual_at_.push_back(r);
    jacobian_at_.push_back(j);
    int columns = 0;
    for (int u : f.unknowns) {
      if (slot_[static_cast<size_t>(u)] >= 0) columns += unknowns[static_cast<size_t>(u)].Tangent();
    }
    columns_.push_back(columns);
    const auto rows = static_cast<size_t>(f.cost->num_residuals());
    r += rows;
    j += rows * static_cast<size_t>(columns);
  }
  residuals_.assign(r, 0);
  jacobians_.assign(j, 0);
  weights_.assign(factors.size(), 1);
  costs_.assign(factors.size(), 0);
}

void BlockSolver::EvaluateFactors(bool with_jacobians, int threads, const CancelToken& cancel) {
  const auto count = static_cast<int64_t>(factors.size());
  ParallelFor((count + kFactorBatch - 1) / kFactorBatch, threads, cancel, [&](int64_t batch) {
    std::vector<double> raw;
    std::vector<const double*> parameters;
    std::vector<double*> pointers;
    Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
    const int64_t end = std::min(count, (batch + 1) * kFactorBatch);
    for (int64_t n = batch * kFactorBatch; n < end; ++n) {
      const auto i = static_cast<size_t>(n);
      const Factor& f = factors[i];
      const int rows = f.cost->num_residuals();
      parameters.clear(), pointers.clear();
      int size = 0;
      for (int u : f.unknowns) size += unknowns[static_cast<size_t>(u)].size;
      raw.resize(CellCount(rows, size));
      int at = 0;
      for (int u : f.unknowns) {
        const Unknown& unknown = unknowns[static_cast<size_t>(u)];
        parameters.push_back(unknown.value.data());
        pointers.push_back(slot_[static_cast<size_t>(u)] >= 0 ? raw.data() + at : nullptr);
        at += rows * unknown.size;
      }
      Eigen::Map<Eigen::VectorXd> residual(&residuals_[residual_at_[i]], rows);
      double rho[3] = {0, 1, 0};
      if (!f.cost->Evaluate(parameters.data(), residual.data(), with_jacobians ? pointers.data() : nullptr)) {
        costs_[i] = std::numeric_limits<double>::infinity();
        continue;
      }
      const double square = residual.squaredNorm();
      rho[0] = square;
      if (f.loss != nullptr) f.loss->Evaluate(square, rho);
      costs_[i] = 0.5 * rho[0];
      weights_[i] = rho[1];
      if (!with_jacobians) continue;
      const double root = std::sqrt(rho[1]);
      residual *= root;
      Eigen::Map<Eigen::MatrixXd> jacobian(&jacobians_[jacobian_at_[i]], rows, columns_[i]);
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      int column = 0;
      for (size_t k = 0; k < f.unknowns.size(); ++k) {
        if (pointers[k] == nullptr) continue;
        const Unknown& unknown = unknowns[static_cast<size_t>(f.unknowns[k])];
        const Eigen::Map<const RowMajor> ambient(pointers[k], rows, unknown.size);
        if (unknown.size == 7) {
          Rigid3Manifold().PlusJacobian(unknown.value.data(), plus.data());
          jacobian.middleCols(column, 6).noalias() = root * (ambient * plus);
        } else {
          jacobian.middleCols(column, unknown.size) = root * ambient;
        }
        column += unknown.Tangent();
      }
    }
  });
}

bool BlockSolver::TermsOf(size_t point, double damping, PointTerms* terms) const {
  terms->hessian.setZero();
  terms->gradient.setZero();
  terms->cost = 0;
  terms->slots.clear(), terms->own.clear(), terms->mixed.clear(), terms->own_gradient.clear();
  const TiePoint& p = points[point];
  Matrix23d by_point;
  Eigen::Matrix<double, 2, 6> by_body;
  for (size_t i = first_sight_[point]; i < first_sight_[point + 1]; ++i) {
    const TieSight& s = sights[i];
    const TieView& view = views[static_cast<size_t>(s.view)];
    bool in_front = false;
    Eigen::Vector2d r = TieResidual(s, view, Pose(s.pose), p.position, &by_point, &by_body, &in_front);
    double rho[3] = {r.squaredNorm(), 1, 0};
    if (view.loss != nullptr) view.loss->Evaluate(r.squaredNorm(), rho);
    terms->cost += 0.5 * rho[0];
    const double root = std::sqrt(rho[1]);
    r *= root, by_point *= root, by_body *= root;
    terms->hessian.noalias() += by_point.transpose() * by_point;
    terms->gradient.noalias() += by_point.transpose() * r;
    const int slot = slot_[static_cast<size_t>(s.pose)];
    if (slot < 0) continue;
    const auto at = std::lower_bound(terms->slots.begin(), terms->slots.end(), slot);
    const auto k = at - terms->slots.begin();
    if (at == terms->slots.end() || *at != slot) {
      terms->slots.insert(at, slot);
      terms->own.insert(terms->own.begin() + k, Matrix6d::Zero());
      terms->mixed.insert(terms->mixed.begin() + k, Matrix63d::Zero());
      terms->own_gradient.insert(terms->own_gradient.begin() + k, Vector6d::Zero());
    }
    terms->own[static_cast<size_t>(k)].noalias() += by_body.transpose() * by_body;
    terms->mixed[static_cast<size_t>(k)].noalias() += by_body.transpose() * by_point;
    terms->own_gradient[static_cast<size_t>(k)].noalias() += by_body.transpose() * r;
  }
  if (p.inverse_sigma.maxCoeff() > 0) {
    const Eigen::Vector3d r = p.inverse_sigma.cwiseProduct(p.position - p.known);
    terms->cost += 0.5 * r.squaredNorm();
    terms->hessian.diagonal() += p.inverse_sigma.cwiseAbs2();
    terms->gradient += p.inverse_sigma.cwiseProduct(r);
  }
  terms->hessian.diagonal() *= 1 + damping;
  // A point that its rays hardly fix says nothing about the poses.
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(terms->hessian);
  return ldlt.isPositive() && ldlt.vectorD().minCoeff() > 1e-10 * ldlt.vectorD().maxCoeff();
}

double BlockSolver::Build(int threads, const CancelToken& cancel, double damping) {
  EvaluateFactors(true, threads, cancel);
  normal_.assign(pairs_.size(), Matrix6d::Zero());
  for (size_t u = 0; u < unknowns.size(); ++u) {
    if (slot_[u] < 0) continue;
    normal_[first_pair_[static_cast<size_t>(slot_[u])]].diagonal().tail(6 - unknowns[u].Tangent()).setOnes();
  }
  gradient_ = Eigen::VectorXd::Zero(Equations());
  double cost = 0;
  for (size_t i = 0; i < factors.size(); ++i) {
    cost += costs_[i];
    const Factor& f = factors[i];
    const int rows = f.cost->num_residuals();
    const Eigen::Map<const Eigen::MatrixXd> j(&jacobians_[jacobian_at_[i]], rows, columns_[i]);
    const Eigen::Map<const Eigen::VectorXd> r(&residuals_[residual_at_[i]], rows);
    int column_a = 0;
    for (size_t a = 0; a < f.unknowns.size(); ++a) {
      const int slot_a = slot_[static_cast<size_t>(f.unknowns[a])];
      if (slot_a < 0) continue;
      const int size_a = unknowns[static_cast<size_t>(f.unknowns[a])].Tangent();
      const auto of_a = j.middleCols(column_a, size_a);
      gradient_.segment(6 * slot_a, size_a).noalias() += of_a.transpose() * r;
      int column_b = 0;
      for (size_t b = 0; b <= a; ++b) {
        const int slot_b = slot_[static_cast<size_t>(f.unknowns[b])];
        if (slot_b < 0) continue;
        const int size_b = unknowns[static_cast<size_t>(f.unknowns[b])].Tangent();
        const auto of_b = j.middleCols(column_b, size_b);
        if (slot_a >= slot_b) {
          normal_[PairIndex(slot_a, slot_b)].topLeftCorner(size_a, size_b).noalias() += of_a.transpose() * of_b;
        } else {
          normal_[PairIndex(slot_b, slot_a)].topLeftCorner(size_b, size_a).noalias() += of_b.transpose() * of_a;
        }
        column_b += size_b;
      }
      column_a += size_a;
    }
  }
  if (!points.empty()) {
    std::vector<Chunk> chunks(kChunks);
    ParallelFor(kChunks, threads, cancel, [&](int64_t c) {
      Chunk& chunk = chunks[static_cast<size_t>(c)];
      chunk.normal.assign(pairs_.size(), Matrix6d::Zero());
      chunk.gradient = Eigen::VectorXd::Zero(Equations());
      PointTerms t;
      const size_t begin = points.size() * static_cast<size_t>(c) / kChunks;
      const size_t end = points.size() * static_cast<size_t>(c + 1) / kChunks;
      for (size_t p = begin; p < end; ++p) {
        if (first_sight_[p] == first_sight_[p + 1]) continue;
        if (p % 1024 == 0) cancel.ThrowIfCancelled();
        const bool firm = TermsOf(p, damping, &t);
        chunk.cost += t.cost;
        if (!firm) continue;
        const Eigen::Matrix3d inverse = t.hessian.inverse();
        for (size_t b = 0; b < t.slots.size(); ++b) {
          const Matrix63d lifted = t.mixed[b] * inverse;
          chunk.gradient.segment<6>(6 * t.slots[b]) += t.own_gradient[b] - lifted * t.gradient;
          size_t at = first_pair_[static_cast<size_t>(t.slots[b])];
          chunk.normal[at] += t.own[b];
          for (size_t a = b; a < t.slots.size(); ++a) {
            while (pairs_[at].first != t.slots[a]) ++at;
            chunk.normal[at].noalias() -= t.mixed[a] * lifted.transpose();
          }
        }
      }
    });
    for (const Chunk& chunk : chunks) {
      for (size_t k = 0; k < normal_.size(); ++k) normal_[k] += chunk.normal[k];
      gradient_ += chunk.gradient;
      cost += chunk.cost;
    }
  }
  return cost;
}

double BlockSolver::Cost(int threads, const CancelToken& cancel) {
  EvaluateFactors(false, threads, cancel);
  double cost = 0;
  for (double c : costs_) cost += c;
  std::vector<double> sums(kChunks, 0.0);
  if (!points.empty()) {
    ParallelFor(kChunks, threads, cancel, [&](int64_t c) {
      const size_t begin = points.size() * static_cast<size_t>(c) / kChunks;
      const size_t end = points.size() * static_cast<size_t>(c + 1) / kChunks;
      for (size_t p = begin; p < end; ++p) {
        for (size_t i = first_sight_[p]; i < first_sight_[p + 1]; ++i) {
          const TieView& view = views[static_cast<size_t>(sights[i].view)];
          bool in_front = false;
          const double square =
              TieResidual(sights[i], view, Pose(sights[i].pose), points[p].position, nullptr, nullptr, &in_front)
                  .squaredNorm();
          double rho[3] = {square, 1, 0};
          if (view.loss != nullptr) view.loss->Evaluate(square, rho);
          sums[static_cast<size_t>(c)] += 0.5 * rho[0];
        }
        sums[static_cast<size_t>(c)] +=
            0.5 * points[p].inverse_sigma.cwiseProduct(points[p].position - points[p].known).squaredNorm();
      }
    });
  }
  for (double s : sums) cost += s;
  return cost;
}

BlockSolver::Summary BlockSolver::Solve(int max_iterations, int threads, ProgressSink& progress,
                                        const CancelToken& cancel) {
  Prepare();
  Summary summary;
  double lambda = 1e-4;
  bool factorised = false;
  for (int it = 0; it < max_iterations && !summary.converged; ++it) {
    cancel.ThrowIfCancelled();
    bool accepted = false;
    for (int attempt = 0; attempt < 10 && !accepted && !summary.converged; ++attempt) {
      const double cost = Build(threads, cancel, lambda);
      if (!std::isfinite(cost)) throw NumericError("the tag map has a residual that is not finite");
      if (it == 0 && attempt == 0) summary.cost_before = cost;
      summary.cost_after = cost;
      // What is seen by points alone that say nothing stays where it is.
      for (int s = 0; s < slots_; ++s) {
        auto diagonal = normal_[first_pair_[static_cast<size_t>(s)]].diagonal();
        diagonal = diagonal.cwiseMax(1e-12).eval();
      }
      if (!cholesky_->Factorize(normal_, lambda)) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      factorised = true;
      Eigen::VectorXd step = -gradient_;
      cholesky_->Solve(step);
      if (!step.allFinite()) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      // The step of each point, then everything moves.
      const std::vector<Unknown> old_unknowns = unknowns;
      const std::vector<TiePoint> old_points = points;
      const double decrease = -gradient_.dot(step);
      if (!points.empty()) {
        std::vector<Eigen::Vector3d> moved(points.size(), Eigen::Vector3d::Zero());
        ParallelFor(kChunks, threads, cancel, [&](int64_t c) {
          PointTerms t;
          const size_t begin = points.size() * static_cast<size_t>(c) / kChunks;
          const size_t end = points.size() * static_cast<size_t>(c + 1) / kChunks;
          for (size_t p = begin; p < end; ++p) {
            if (first_sight_[p] == first_sight_[p + 1] || !TermsOf(p, lambda, &t)) continue;
            Eigen::Vector3d right = -t.gradient;
            for (size_t a = 0; a < t.slots.size(); ++a) {
              right -= t.mixed[a].transpose() * step.segment<6>(6 * t.slots[a]);
            }
            moved[p] = t.hessian.ldlt().solve(right);
          }
        });
        for (size_t p = 0; p < points.size(); ++p) {
          if (moved[p].allFinite()) points[p].position += moved[p];
        }
      }
      for (size_t u = 0; u < unknowns.size(); ++u) {
        if (slot_[u] < 0) continue;
        Unknown& unknown = unknowns[u];
        const int offset = Offset(static_cast<int>(u));
        if (unknown.size == 7) {
          Rigid3ToBlock(Pose(static_cast<int>(u)).Plus(step.segment<6>(offset)), unknown.value.data());
        } else {
          for (int k = 0; k < unknown.size; ++k) unknown.value[static_cast<size_t>(k)] += step[offset + k];
        }
      }
      const double fresh = Cost(threads, cancel);
      if (std::isfinite(fresh) && fresh <= cost) {
        summary.cost_after = fresh;
        accepted = true;
        lambda = std::max(1e-9, lambda * 0.2);
        summary.converged = decrease < kEnoughDecrease || cost - fresh < 1e-9 * cost;
      } else {
        unknowns = old_unknowns;
        points = old_points;
        lambda = std::max(lambda, 1e-8) * 8;
        if (decrease < kEnoughDecrease) summary.converged = true;  // rounding
      }
    }
    ++summary.iterations;
    progress.Advance(1);
    if (!accepted && !summary.converged) {
      if (!factorised) {
        throw NumericError("the survey's equations are singular: something shares no data with the rest");
      }
      break;
    }
  }
  return summary;
}

void BlockSolver::Linearise(int threads, const CancelToken& cancel, bool open) {
  Build(threads, cancel, 0);
  if (!cholesky_->Factorize(normal_, 0)) {
    if (!open) throw NumericError("the survey's equations are singular: something shares no data with the rest");
    // Something that the data leave open, such as the way a few tags can turn together: it gets a sigma that says so.
    for (int s = 0; s < slots_; ++s) {
      auto diagonal = normal_[first_pair_[static_cast<size_t>(s)]].diagonal();
      diagonal += 1e-9 * diagonal.cwiseMax(1.0);
    }
    if (!cholesky_->Factorize(normal_, 0)) {
      throw NumericError("the survey's equations are singular: something shares no data with the rest");
    }
  }
  inverse_ = cholesky_->SelectedInverse();
}

Eigen::MatrixXd BlockSolver::Covariance(int row, int column, int rows, int columns) const {
  return inverse_.Block(row / 6, column / 6).block(row % 6, column % 6, rows, columns);
}

Eigen::MatrixXd BlockSolver::SolveNormal(Eigen::MatrixXd right) const {
  for (Eigen::Index k = 0; k < right.cols(); ++k) cholesky_->Solve(right.col(k));
  return right;
}

Eigen::MatrixXd BlockSolver::CovarianceColumns(int first, int count) const {
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(Equations(), count);
  for (int i = 0; i < count; ++i) right(first + i, i) = 1;
  return SolveNormal(std::move(right));
}

Matrix6d BlockSolver::PoseCovariance(int unknown) const {
  const int slot = slot_[static_cast<size_t>(unknown)];
  return slot < 0 ? Matrix6d(Matrix6d::Zero()) : inverse_.Block(slot, slot);
}

Eigen::VectorXd BlockSolver::Residual(int factor) const {
  const auto i = static_cast<size_t>(factor);
  const double root = std::sqrt(std::max(1e-300, weights_[i]));
  return Eigen::Map<const Eigen::VectorXd>(&residuals_[residual_at_[i]], factors[i].cost->num_residuals()) / root;
}

double BlockSolver::Weight(int factor) const { return weights_[static_cast<size_t>(factor)]; }

Eigen::MatrixXd BlockSolver::Jacobian(int factor) const {
  const auto i = static_cast<size_t>(factor);
  return Eigen::Map<const Eigen::MatrixXd>(&jacobians_[jacobian_at_[i]], factors[i].cost->num_residuals(), columns_[i]);
}

void BlockSolver::AddTransposed(int factor, const Eigen::MatrixXd& a, Eigen::MatrixXd* into) const {
  const Eigen::MatrixXd product = Jacobian(factor).transpose() * a;
  Eigen::Index from = 0;
  for (int u : factors[static_cast<size_t>(factor)].unknowns) {
    if (slot_[static_cast<size_t>(u)] < 0) continue;
    const Eigen::Index size = unknowns[static_cast<size_t>(u)].Tangent();
    into->middleRows(Offset(u), size) += product.middleRows(from, size);
    from += size;
  }
}

Eigen::MatrixXd BlockSolver::Absorbed(int factor) const {
  const std::vector<int>& its = factors[static_cast<size_t>(factor)].unknowns;
  const Eigen::MatrixXd j = Jacobian(factor);
  Eigen::MatrixXd q(j.cols(), j.cols());
  Eigen::Index row = 0;
  for (int a : its) {
    const int slot_a = slot_[static_cast<size_t>(a)], size_a = unknowns[static_cast<size_t>(a)].Tangent();
    if (slot_a < 0) continue;
    Eigen::Index column = 0;
    for (int b : its) {
      const int slot_b = slot_[static_cast<size_t>(b)], size_b = unknowns[static_cast<size_t>(b)].Tangent();
      if (slot_b < 0) continue;
      q.block(row, column, size_a, size_b) = inverse_.Block(slot_a, slot_b).topLeftCorner(size_a, size_b);
      column += size_b;
    }
    row += size_a;
  }
  return j * q * j.transpose();
}

}  // namespace trigpoint
