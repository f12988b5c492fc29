#include "calib/estimation/bundle.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "calib/base/parallel.h"

namespace trigpoint {
namespace {

using Matrix26 = Eigen::Matrix<double, 2, 6>;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using SparseLdlt = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::AMDOrdering<int>>;

constexpr int kChunks = 8;  // fixed, so that sums do not depend on the number of threads

struct ObservationTerms {
  Eigen::Vector2d r;
  Matrix26 jp;
  Matrix23 jy;
};

// Residual and Jacobians of one observation. Returns false behind the view.
template <bool kJacobians>
bool Evaluate(const BundleProblem& p, const BearingObservation& o, const Eigen::Vector3d& y, ObservationTerms* out) {
  const Rigid3d& pose = p.poses[static_cast<size_t>(o.pose)];
  const Rigid3d& view = p.views[static_cast<size_t>(o.view)];
  const Eigen::Vector3d in_rig_rotated = pose.rotation * y;
  const Eigen::Vector3d q = view * (in_rig_rotated + pose.translation);
  const double n = q.norm();
  if (!(n > 1e-9)) return false;
  const Eigen::Vector3d u = q / n;
  if (u.dot(o.ray.cast<double>()) <= 0) return false;
  const Matrix23 w = o.w.cast<double>();
  out->r = w * u;
  if constexpr (kJacobians) {
    const Matrix23 dq = (w - out->r * u.transpose()) / n;  // W (I - u u^T) / n
    const Matrix23 drig = dq * view.rotation.toRotationMatrix();
    out->jp.leftCols<3>() = -drig * Skew(in_rig_rotated);
    out->jp.rightCols<3>() = drig;
    out->jy = drig * pose.rotation.toRotationMatrix();
  }
  return true;
}

double Rho(const ceres::LossFunction* loss, double s, double* weight) {
  if (loss == nullptr) {
    *weight = 1;
    return s;
  }
  double rho[3];
  loss->Evaluate(s, rho);
  *weight = rho[1];
  return rho[0];
}

struct FactorTerms {
  Vector6d r;
  Matrix6d ja, jb;
  Vector6d js;
};

void EvaluateFactor(const BundleProblem& p, const PoseFactor& f, FactorTerms* out) {
  const Rigid3d& a = p.poses[static_cast<size_t>(f.a)];
  out->ja.setZero();
  out->jb.setZero();
  out->js.setZero();
  Vector6d e = Vector6d::Zero();
  switch (f.kind) {
    case PoseFactor::Kind::kBetween: {
      const Rigid3d& b = p.poses[static_cast<size_t>(f.b)];
      const Eigen::Quaterniond q = a.rotation * b.rotation.conjugate();
      const Eigen::Matrix3d rp = q.toRotationMatrix();
      const Eigen::Vector3d rtb = rp * b.translation;
      const double s = f.scaled ? p.scale : 1.0;
      e.head<3>() = LogSO3(q * f.measured.rotation.conjugate());
      e.tail<3>() = a.translation - rtb - s * f.measured.translation;
      const Eigen::Matrix3d jl = LeftJacobianInverseSO3(e.head<3>());
      out->ja.topLeftCorner<3, 3>() = jl;
      out->ja.bottomLeftCorner<3, 3>() = Skew(rtb);
      out->ja.bottomRightCorner<3, 3>().setIdentity();
      out->jb.topLeftCorner<3, 3>() = -jl * rp;
      out->jb.bottomLeftCorner<3, 3>() = -Skew(rtb) * rp;
      out->jb.bottomRightCorner<3, 3>() = -rp;
      if (f.scaled) out->js.tail<3>() = -f.measured.translation;
      break;
    }
    case PoseFactor::Kind::kPrior: {
      e = a.Minus(f.measured);
      out->ja.topLeftCorner<3, 3>() = LeftJacobianInverseSO3(e.head<3>());
      out->ja.bottomRightCorner<3, 3>().setIdentity();
      break;
    }
    case PoseFactor::Kind::kGeotag: {
      const Rigid3d inverse = a.Inverse();
      e = inverse.Minus(f.measured);
      const Eigen::Matrix3d rt = inverse.rotation.toRotationMatrix();
      out->ja.topLeftCorner<3, 3>() = -LeftJacobianInverseSO3(e.head<3>()) * rt;
      out->ja.bottomLeftCorner<3, 3>() = -rt * Skew(a.translation);
      out->ja.bottomRightCorner<3, 3>() = -rt;
      break;
    }
    case PoseFactor::Kind::kPosition: {
      const Eigen::Matrix3d rt = a.rotation.conjugate().toRotationMatrix();
      const Eigen::Vector3d d = f.arm - a.translation;
      e.tail<3>() = rt * d - f.measured.translation;
      out->ja.bottomLeftCorner<3, 3>() = rt * Skew(d);
      out->ja.bottomRightCorner<3, 3>() = -rt;
      break;
    }
  }
  out->r = f.sqrt_info * e;
  out->ja = f.sqrt_info * out->ja;
  out->jb = f.sqrt_info * out->jb;
  out->js = f.sqrt_info * out->js;
}

// Ranges of observations of each point, and of points for each chunk.
struct Layout {
  std::vector<int> first;                  // first[point] .. first[point + 1]
  std::vector<int> slot;                   // pose -> block of the reduced system, -1 constant
  int blocks = 0;                          // free poses
  int dimension = 0;                       // 6 * blocks + (scale free)
  std::vector<std::pair<int, int>> chunk;  // points [begin, end)

  explicit Layout(const BundleProblem& p) {
    first.assign(p.points.size() + 1, 0);
    for (const BearingObservation& o : p.observations) ++first[static_cast<size_t>(o.point) + 1];
    for (size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    slot.assign(p.poses.size(), -1);
    for (size_t i = 0; i < p.poses.size(); ++i) {
      if (p.pose_constant.empty() || !p.pose_constant[i]) slot[i] = blocks++;
    }
    dimension = 6 * blocks + (p.scale_constant ? 0 : 1);
    // Chunks of about equal numbers of observations.
    const int n = static_cast<int>(p.points.size());
    int begin = 0;
    for (int c = 0; c < kChunks; ++c) {
      const int64_t target = static_cast<int64_t>(p.observations.size()) * (c + 1) / kChunks;
      int end = begin;
      while (end < n && (first[static_cast<size_t>(end)] < target || c == kChunks - 1)) ++end;
      chunk.emplace_back(begin, end);
      begin = end;
    }
  }
};

// The pattern of the reduced system: lower block triangle, blocks of 6 x 6 keyed by (row, col), row >= col.
class BlockMatrix {
 public:
  int Find(int row, int col) const { return index_.at(Key(row, col)); }
  void Add(int row, int col) {
    const auto [it, fresh] = index_.try_emplace(Key(row, col), static_cast<int>(rows_.size()));
    if (fresh) {
      rows_.push_back(row);
      cols_.push_back(col);
    }
  }
  int size() const { return static_cast<int>(rows_.size()); }
  int row(int k) const { return rows_[static_cast<size_t>(k)]; }
  int col(int k) const { return cols_[static_cast<size_t>(k)]; }

 private:
  static int64_t Key(int row, int col) { return (static_cast<int64_t>(row) << 32) | static_cast<uint32_t>(col); }
  std::unordered_map<int64_t, int> index_;
  std::vector<int> rows_, cols_;
};

BlockMatrix MakePattern(const BundleProblem& p, const Layout& layout) {
  BlockMatrix pattern;
  for (int b = 0; b < layout.blocks; ++b) pattern.Add(b, b);
  std::vector<int> slots;
  for (size_t j = 0; j + 1 < layout.first.size() && !p.points_constant; ++j) {
    slots.clear();
    for (int k = layout.first[j]; k < layout.first[j + 1]; ++k) {
      const BearingObservation& o = p.observations[static_cast<size_t>(k)];
      if (o.active && layout.slot[static_cast<size_t>(o.pose)] >= 0) {
        slots.push_back(layout.slot[static_cast<size_t>(o.pose)]);
      }
    }
    std::sort(slots.begin(), slots.end());
    slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
    for (size_t a = 0; a < slots.size(); ++a) {
      for (size_t b = 0; b < a; ++b) pattern.Add(slots[a], slots[b]);
    }
  }
  for (const PoseFactor& f : p.factors) {
    if (f.b < 0) continue;
    const int a = layout.slot[static_cast<size_t>(f.a)], b = layout.slot[static_cast<size_t>(f.b)];
    if (a >= 0 && b >= 0 && a != b) pattern.Add(std::max(a, b), std::min(a, b));
  }
  return pattern;
}

struct PointSystem {
  Eigen::Matrix3d h;
  Eigen::Vector3d g;
};

// The normal equations reduced to poses and scale, and what is needed to get the points back.
struct Reduced {
  std::vector<Matrix6d> blocks;
  Eigen::VectorXd gradient;      // J^T r reduced
  Eigen::VectorXd scale_column;  // of free poses, when the scale is free
  double scale_diagonal = 0;
  double cost = 0;
};

class Reducer {
 public:
  Reducer(const BundleProblem& p, int threads, const CancelToken& cancel)
      : p_(p), threads_(threads), cancel_(cancel), layout_(p), pattern_(MakePattern(p, layout_)) {
    points_.resize(p.points.size());
  }
  const Layout& layout() const { return layout_; }
  const BlockMatrix& pattern() const { return pattern_; }

  // Builds the reduced system with damping `lambda` on the points' diagonals.
  Reduced Build(double lambda, std::vector<PoseFactor>* factors_out) {
    std::vector<Reduced> parts(kChunks);
    ParallelFor(kChunks, threads_, cancel_,
                [&](int64_t c) { BuildChunk(static_cast<size_t>(c), lambda, &parts[static_cast<size_t>(c)]); });
    Reduced sum = std::move(parts[0]);
    for (size_t c = 1; c < parts.size(); ++c) {
      for (size_t k = 0; k < sum.blocks.size(); ++k) sum.blocks[k] += parts[c].blocks[k];
      sum.gradient += parts[c].gradient;
      sum.cost += parts[c].cost;
    }
    AddFactors(&sum, factors_out);
    return sum;
  }

  // Back substitution: the points' steps for given pose steps.
  void PointSteps(const Eigen::VectorXd& step, double lambda, std::vector<Eigen::Vector3d>* out) const {
    out->assign(p_.points.size(), Eigen::Vector3d::Zero());
    if (p_.points_constant) return;
    ParallelFor(kChunks, threads_, cancel_, [&](int64_t c) {
      const auto [begin, end] = layout_.chunk[static_cast<size_t>(c)];
      for (int j = begin; j < end; ++j) {
        const PointSystem& system = points_[static_cast<size_t>(j)];
        Eigen::Vector3d g = system.g;
        for (int k = layout_.first[static_cast<size_t>(j)]; k < layout_.first[static_cast<size_t>(j) + 1]; ++k) {
          const BearingObservation& o = p_.observations[static_cast<size_t>(k)];
          const int slot = layout_.slot[static_cast<size_t>(o.pose)];
          ObservationTerms t;
          if (slot < 0 || !o.active || !Evaluate<true>(p_, o, p_.points[static_cast<size_t>(j)], &t)) continue;
          double weight = 1;
          Rho(p_.loss.get(), t.r.squaredNorm(), &weight);
          g += weight * t.jy.transpose() * (t.jp * step.segment<6>(6 * slot));
        }
        (*out)[static_cast<size_t>(j)] = -Damped(system.h, lambda).ldlt().solve(g);
      }
    });
  }

  double Cost(const BundleProblem& p) const {
    std::vector<double> parts(kChunks, 0.0);
    ParallelFor(kChunks, threads_, cancel_, [&](int64_t c) {
      const auto [begin, end] = layout_.chunk[static_cast<size_t>(c)];
      double cost = 0;
      for (int k = layout_.first[static_cast<size_t>(begin)]; k < layout_.first[static_cast<size_t>(end)]; ++k) {
        const BearingObservation& o = p.observations[static_cast<size_t>(k)];
        if (!o.active) continue;
        ObservationTerms t;
        double weight = 1;
        // A point that a step has put behind its view must never look cheap.
        const double s = Evaluate<false>(p, o, p.points[static_cast<size_t>(o.point)], &t) ? t.r.squaredNorm() : 1e8;
        cost += 0.5 * Rho(p.loss.get(), s, &weight);
      }
      parts[static_cast<size_t>(c)] = cost;
    });
    double sum = 0;
    for (double c : parts) sum += c;
    for (const PoseFactor& f : p.factors) {
      FactorTerms t;
      EvaluateFactor(p, f, &t);
      double weight = 1;
      sum += 0.5 * Rho(f.loss.get(), t.r.squaredNorm(), &weight);
    }
    if (!p.scale_constant) sum += 0.5 * std::pow((p.scale - p.scale_prior) / p.scale_sigma, 2);
    return sum;
  }

  static Eigen::Matrix3d Damped(const Eigen::Matrix3d& h, double lambda) {
    Eigen::Matrix3d d = h;
    // A trace part keeps points without parallax (rank 2) solvable: they do not move along their ray.
    d.diagonal() += lambda * h.diagonal() + Eigen::Vector3d::Constant(1e-12 * h.trace() + 1e-300);
    return d;
  }

 private:
  void BuildChunk(size_t c, double lambda, Reduced* out) {
    out->blocks.assign(static_cast<size_t>(pattern_.size()), Matrix6d::Zero());
    out->gradient = Eigen::VectorXd::Zero(layout_.dimension);
    struct Term {
      int slot;
      Eigen::Matrix<double, 6, 3> hpy;
      Eigen::Matrix<double, 6, 3> reduced;
    };
    std::vector<Term> terms;
    const auto [begin, end] = layout_.chunk[c];
    for (int j = begin; j < end; ++j) {
      if (j % 4096 == 0) cancel_.ThrowIfCancelled();
      PointSystem& system = points_[static_cast<size_t>(j)];
      system.h.setZero();
      system.g.setZero();
      terms.clear();
      for (int k = layout_.first[static_cast<size_t>(j)]; k < layout_.first[static_cast<size_t>(j) + 1]; ++k) {
        const BearingObservation& o = p_.observations[static_cast<size_t>(k)];
        if (!o.active) continue;
        ObservationTerms t;
        double weight = 1;
        if (!Evaluate<true>(p_, o, p_.points[static_cast<size_t>(j)], &t)) {
          out->cost += 0.5 * Rho(p_.loss.get(), 1e8, &weight);
          continue;
        }
        out->cost += 0.5 * Rho(p_.loss.get(), t.r.squaredNorm(), &weight);
        const Matrix23 wjy = weight * t.jy;
        system.h += t.jy.transpose() * wjy;
        system.g += wjy.transpose() * t.r;
        const int slot = layout_.slot[static_cast<size_t>(o.pose)];
        if (slot < 0) continue;
        out->blocks[static_cast<size_t>(slot)].noalias() += weight * t.jp.transpose() * t.jp;  // diagonals come first
        out->gradient.segment<6>(6 * slot) += weight * t.jp.transpose() * t.r;
        terms.push_back({slot, t.jp.transpose() * wjy, Eigen::Matrix<double, 6, 3>::Zero()});
      }
      if (terms.empty() || p_.points_constant) continue;
      const Eigen::Matrix3d inverse = Damped(system.h, lambda).inverse();
      if (!inverse.allFinite()) continue;
      const Eigen::Vector3d hg = inverse * system.g;
      for (Term& t : terms) {
        t.reduced = t.hpy * inverse;
        out->gradient.segment<6>(6 * t.slot) -= t.hpy * hg;
      }
      for (size_t a = 0; a < terms.size(); ++a) {
        for (size_t b = 0; b < terms.size(); ++b) {
          const int row = terms[a].slot, col = terms[b].slot;
          if (row < col) continue;
          const int k = row == col ? row : pattern_.Find(row, col);
          out->blocks[static_cast<size_t>(k)].noalias() -= terms[a].reduced * terms[b].hpy.transpose();
        }
      }
    }
  }

  void AddFactors(Reduced* sum, std::vector<PoseFactor>* factors_out) {
    sum->scale_column = Eigen::VectorXd::Zero(6 * layout_.blocks);
    for (size_t i = 0; i < p_.factors.size(); ++i) {
      const PoseFactor& f = p_.factors[i];
      FactorTerms t;
      EvaluateFactor(p_, f, &t);
      double weight = 1;
      sum->cost += 0.5 * Rho(f.loss.get(), t.r.squaredNorm(), &weight);
      if (factors_out != nullptr) (*factors_out)[i].weight = weight;
      const int a = layout_.slot[static_cast<size_t>(f.a)];
      const int b = f.b >= 0 ? layout_.slot[static_cast<size_t>(f.b)] : -1;
      if (a >= 0) {
        sum->blocks[static_cast<size_t>(a)] += weight * t.ja.transpose() * t.ja;
        sum->gradient.segment<6>(6 * a) += weight * t.ja.transpose() * t.r;
      }
      if (b >= 0) {
        sum->blocks[static_cast<size_t>(b)] += weight * t.jb.transpose() * t.jb;
        sum->gradient.segment<6>(6 * b) += weight * t.jb.transpose() * t.r;
        if (a > b) sum->blocks[static_cast<size_t>(pattern_.Find(a, b))] += weight * t.ja.transpose() * t.jb;
        if (a >= 0 && a < b) sum->blocks[static_cast<size_t>(pattern_.Find(b, a))] += weight * t.jb.transpose() * t.ja;
      }
      if (!p_.scale_constant && f.scaled) {
        const int s = 6 * layout_.blocks;
        if (a >= 0) sum->scale_column.segment<6>(6 * a) += weight * t.ja.transpose() * t.js;
        if (b >= 0) sum->scale_column.segment<6>(6 * b) += weight * t.jb.transpose() * t.js;
        sum->scale_diagonal += weight * t.js.squaredNorm();
        sum->gradient(s) += weight * t.js.dot(t.r);
      }
    }
    if (!p_.scale_constant) {
      const double e = (p_.scale - p_.scale_prior) / p_.scale_sigma;
      sum->cost += 0.5 * e * e;
      sum->scale_diagonal += 1 / (p_.scale_sigma * p_.scale_sigma);
      sum->gradient(6 * layout_.blocks) += e / p_.scale_sigma;
    }
  }

  const BundleProblem& p_;
  int threads_;
  const CancelToken& cancel_;
  Layout layout_;
  BlockMatrix pattern_;
  std::vector<PointSystem> points_;
};

// The scalar sparse matrix (lower triangle) of a reduced system, with relative damping of the diagonal.
Eigen::SparseMatrix<double> ToSparse(const Reduced& r, const BlockMatrix& pattern, const Layout& layout,
                                     bool with_scale, double lambda) {
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(static_cast<size_t>(pattern.size()) * 36 + static_cast<size_t>(layout.dimension));
  for (int k = 0; k < pattern.size(); ++k) {
    const int row = 6 * pattern.row(k), col = 6 * pattern.col(k);
    const Matrix6d& m = r.blocks[static_cast<size_t>(k)];
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        if (row == col && j > i) continue;
        double v = m(i, j);
        if (row == col && i == j) v += lambda * std::abs(v);
        triplets.emplace_back(row + i, col + j, v);
      }
    }
  }
  if (with_scale) {
    const int s = 6 * layout.blocks;
    // Kept dense, zeros included: selected inversion then yields every covariance with the scale.
    for (int i = 0; i < s; ++i) triplets.emplace_back(s, i, r.scale_column(i));
    triplets.emplace_back(s, s, r.scale_diagonal * (1 + lambda));
  }
  Eigen::SparseMatrix<double> m(layout.dimension, layout.dimension);
  m.setFromTriplets(triplets.begin(), triplets.end());
  return m;
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
  const Layout layout(p);
  ParallelFor(kChunks, threads, cancel, [&](int64_t c) {
    const auto [begin, end] = layout.chunk[static_cast<size_t>(c)];
    for (int j = begin; j < end; ++j) {
      const int first = layout.first[static_cast<size_t>(j)], last = layout.first[static_cast<size_t>(j) + 1];
      Eigen::Vector3d y = p.points[static_cast<size_t>(j)];
      if (!y.allFinite()) continue;
      const auto cost_of = [&](const Eigen::Vector3d& at) {
        double cost = 0, weight = 1;
        for (int k = first; k < last; ++k) {
          const BearingObservation& o = p.observations[static_cast<size_t>(k)];
          ObservationTerms t;
          if (!o.active) continue;
          cost += Rho(p.loss.get(), Evaluate<false>(p, o, at, &t) ? t.r.squaredNorm() : 1e8, &weight);
        }
        return cost;
      };
      double cost = cost_of(y), lambda = 1e-4;
      for (int it = 0; it < iterations; ++it) {
        Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
        Eigen::Vector3d g = Eigen::Vector3d::Zero();
        for (int k = first; k < last; ++k) {
          const BearingObservation& o = p.observations[static_cast<size_t>(k)];
          ObservationTerms t;
          if (!o.active || !Evaluate<true>(p, o, y, &t)) continue;
          double weight = 1;
          Rho(p.loss.get(), t.r.squaredNorm(), &weight);
          h += weight * t.jy.transpose() * t.jy;
          g += weight * t.jy.transpose() * t.r;
        }
        const Eigen::Vector3d step = -Reducer::Damped(h, lambda).ldlt().solve(g);
        if (!step.allFinite()) break;
        const double next = cost_of(y + step);
        if (next <= cost) {
          const bool done = cost - next < 1e-8 * cost + 1e-12;
          y += step;
          cost = next;
          lambda = std::max(1e-10, lambda * 0.2);
          if (done) break;
        } else {
          lambda *= 10;
        }
      }
      p.points[static_cast<size_t>(j)] = y;
    }
  });
}

BundleSummary SolveBundle(BundleProblem& p, const BundleOptions& options, ProgressSink& progress,
                          const CancelToken& cancel) {
  BundleSummary summary;
  Reducer reducer(p, options.threads, cancel);
  const Layout& layout = reducer.layout();
  if (layout.dimension == 0) return summary;
  SparseLdlt solver;
  bool analysed = false;
  double lambda = 1e-5;
  summary.initial_cost = summary.final_cost = reducer.Cost(p);
  progress.Begin("bundle adjustment", options.max_iterations);
  std::vector<Eigen::Vector3d> point_steps;
  for (int it = 0; it < options.max_iterations; ++it) {
    summary.iterations = it + 1;
    bool accepted = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      cancel.ThrowIfCancelled();
      const Reduced reduced = reducer.Build(lambda, nullptr);
      const Eigen::SparseMatrix<double> s = ToSparse(reduced, reducer.pattern(), layout, !p.scale_constant, lambda);
      if (!analysed) {
        solver.analyzePattern(s);
        analysed = true;
      }
      solver.factorize(s);
      if (solver.info() != Eigen::Success) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      const Eigen::VectorXd step = -solver.solve(reduced.gradient);
      if (!step.allFinite()) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      reducer.PointSteps(step, lambda, &point_steps);
      const std::vector<Rigid3d> old_poses = p.poses;
      const std::vector<Eigen::Vector3d> old_points = p.points;
      const double old_scale = p.scale;
      for (size_t i = 0; i < p.poses.size(); ++i) {
        if (layout.slot[i] >= 0) p.poses[i] = p.poses[i].Plus(step.segment<6>(6 * layout.slot[i]));
      }
      if (!p.scale_constant) p.scale += step(6 * layout.blocks);
      for (size_t j = 0; j < p.points.size(); ++j) {
        if (point_steps[j].allFinite()) p.points[j] += point_steps[j];
      }
      const double cost = reducer.Cost(p);
      if (std::isfinite(cost) && cost <= summary.final_cost) {
        gain = summary.final_cost - cost;
        summary.final_cost = cost;
        lambda = std::max(1e-9, lambda * 0.2);
        accepted = true;
      } else {
        p.poses = old_poses;
        p.points = old_points;
        p.scale = old_scale;
        lambda = std::max(lambda, 1e-8) * 8;
      }
    }
    progress.Advance(1);
    if (!accepted) {
      if (it == 0 && solver.info() != Eigen::Success) {
        throw NumericError("bundle adjustment: the system is singular; something is not fixed by the data");
      }
      summary.converged = true;
      break;
    }
    if (gain < options.relative_cost_tolerance * summary.final_cost) {
      summary.converged = true;
      break;
    }
  }
  // Leave the factors' final weights for those who report which evidence was believed.
  std::vector<PoseFactor> weighted = p.factors;
  for (size_t i = 0; i < weighted.size(); ++i) {
    FactorTerms t;
    EvaluateFactor(p, weighted[i], &t);
    Rho(weighted[i].loss.get(), t.r.squaredNorm(), &weighted[i].weight);
  }
  p.factors = std::move(weighted);
  return summary;
}

struct BundleCovariance::Impl {
  Layout layout;
  SparseLdlt solver;
  bool with_scale = false;
  size_t poses = 0;
  explicit Impl(const BundleProblem& p) : layout(p), with_scale(!p.scale_constant), poses(p.poses.size()) {}
};

BundleCovariance::BundleCovariance(const BundleProblem& problem, int threads, const CancelToken& cancel)
    : impl_(std::make_unique<Impl>(problem)) {
  Reducer reducer(problem, threads, cancel);
  const Reduced reduced = reducer.Build(0, nullptr);
  impl_->solver.compute(ToSparse(reduced, reducer.pattern(), reducer.layout(), impl_->with_scale, 0));
  if (impl_->solver.info() != Eigen::Success || !(impl_->solver.vectorD().minCoeff() > 0)) {
    throw NumericError("covariance: the system is singular; something is not fixed by the data");
  }
}

BundleCovariance::~BundleCovariance() = default;

int BundleCovariance::Dimension() const { return impl_->layout.dimension; }

Eigen::MatrixXd BundleCovariance::Columns(const std::vector<int>& poses, bool with_scale) const {
  const Layout& layout = impl_->layout;
  const int n_out = 6 * static_cast<int>(impl_->poses) + 1;
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Zero(n_out, 6 * static_cast<Eigen::Index>(poses.size()) + (with_scale ? 1 : 0));
  const auto solve = [&](int reduced_index, Eigen::Index column) {
    Eigen::VectorXd unit = Eigen::VectorXd::Zero(layout.dimension);
    unit(reduced_index) = 1;
    const Eigen::VectorXd x = impl_->solver.solve(unit);
    for (size_t p = 0; p < impl_->poses; ++p) {
      if (layout.slot[p] >= 0) {
        out.block<6, 1>(6 * static_cast<Eigen::Index>(p), column) = x.segment<6>(6 * layout.slot[p]);
      }
    }
    if (impl_->with_scale) out(n_out - 1, column) = x(6 * layout.blocks);
  };
  for (size_t i = 0; i < poses.size(); ++i) {
    const int slot = layout.slot[static_cast<size_t>(poses[i])];
    if (slot < 0) continue;
    for (int k = 0; k < 6; ++k) solve(6 * slot + k, static_cast<Eigen::Index>(6 * i) + k);
  }
  if (with_scale && impl_->with_scale) solve(6 * layout.blocks, out.cols() - 1);
  return out;
}

void BundleCovariance::PoseBlocks(const std::vector<int>& next, std::vector<Matrix6d>* diagonal,
                                  std::vector<Matrix6d>* with_next) const {
  // Selected inversion (Takahashi et al. 1973): the entries of the inverse inside the pattern of L, backwards
  // column by column, at a cost that is linear for banded systems.
  const Layout& layout = impl_->layout;
  const Eigen::SparseMatrix<double> l = impl_->solver.matrixL();
  const Eigen::VectorXd d = impl_->solver.vectorD();
  const Eigen::Index n = l.cols();
  // Strictly lower pattern of each column, ascending.
  std::vector<int> start(static_cast<size_t>(n) + 1, 0), rows;
  std::vector<double> values, inverse;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(l, j); it; ++it) {
      if (it.row() > j) {
        rows.push_back(static_cast<int>(it.row()));
        values.push_back(it.value());
      }
    }
    start[static_cast<size_t>(j) + 1] = static_cast<int>(rows.size());
  }
  inverse.assign(rows.size(), 0.0);
  std::vector<double> diag(static_cast<size_t>(n), 0.0);
  const auto lookup = [&](int row, int col) -> double {
    if (row == col) return diag[static_cast<size_t>(row)];
    const int c = std::min(row, col), r = std::max(row, col);
    const auto begin = rows.begin() + start[static_cast<size_t>(c)];
    const auto end = rows.begin() + start[static_cast<size_t>(c) + 1];
    const auto it = std::lower_bound(begin, end, r);
    return it != end && *it == r ? inverse[static_cast<size_t>(it - rows.begin())] : 0.0;
  };
  std::vector<double> work(static_cast<size_t>(n), 0.0);
  for (int j = static_cast<int>(n) - 1; j >= 0; --j) {
    const int begin = start[static_cast<size_t>(j)], end = start[static_cast<size_t>(j) + 1];
    // z(i, j) = - sum_k z(i, k) l(k, j) for i in the column's pattern; the pattern is closed under this sum.
    for (int a = begin; a < end; ++a) work[static_cast<size_t>(rows[static_cast<size_t>(a)])] = 0;
    for (int k = begin; k < end; ++k) {
      const int col = rows[static_cast<size_t>(k)];
      const double lkj = values[static_cast<size_t>(k)];
      work[static_cast<size_t>(col)] -= diag[static_cast<size_t>(col)] * lkj;
      // Entries of column `col` below the diagonal, merged with this column's pattern.
      int a = k + 1;
      for (int m = start[static_cast<size_t>(col)]; m < start[static_cast<size_t>(col) + 1] && a < end; ++m) {
        const int row = rows[static_cast<size_t>(m)];
        while (a < end && rows[static_cast<size_t>(a)] < row) ++a;
        if (a < end && rows[static_cast<size_t>(a)] == row) {
          const double z = inverse[static_cast<size_t>(m)];
          work[static_cast<size_t>(row)] -= z * lkj;
          work[static_cast<size_t>(col)] -= z * values[static_cast<size_t>(a)];
        }
      }
    }
    double sum = 0;
    for (int a = begin; a < end; ++a) {
      const double z = work[static_cast<size_t>(rows[static_cast<size_t>(a)])];
      inverse[static_cast<size_t>(a)] = z;
      sum += z * values[static_cast<size_t>(a)];
    }
    diag[static_cast<size_t>(j)] = 1.0 / d(j) - sum;
  }
  const auto& permutation = impl_->solver.permutationP().indices();
  const auto entry = [&](int r, int c) { return lookup(permutation(r), permutation(c)); };
  const auto block = [&](int a, int b) {
    Matrix6d m;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) m(i, j) = entry(6 * a + i, 6 * b + j);
    }
    return m;
  };
  diagonal->assign(impl_->poses, Matrix6d::Zero());
  with_next->assign(impl_->poses, Matrix6d::Zero());
  for (size_t p = 0; p < impl_->poses; ++p) {
    const int slot = layout.slot[p];
    if (slot < 0) continue;
    (*diagonal)[p] = block(slot, slot);
    if (p < next.size() && next[p] >= 0 && layout.slot[static_cast<size_t>(next[p])] >= 0) {
      (*with_next)[p] = block(slot, layout.slot[static_cast<size_t>(next[p])]);
    }
  }
}

}  // namespace trigpoint
