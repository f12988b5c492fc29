#include "calib/estimation/bundle.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "calib/base/parallel.h"
#include "calib/estimation/block_cholesky.h"
#include "calib/estimation/bundle_terms.h"

namespace trigpoint {
namespace {

constexpr int kChunks = 8;     // fixed, so that sums do not depend on the number of threads
constexpr int kBatch = 16384;  // observations whose terms are held at a time

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

// Ranges of observations of each point, and of points for each chunk.
struct Layout {
  std::vector<int> first;                  // first[point] .. first[point + 1]
  std::vector<int> slot;                   // pose -> block of the reduced system, -1 constant
  int blocks = 0;                          // free poses
  std::vector<int> scale_slot;             // scale -> among the free ones, -1 constant
  int scales = 0;                          // free ones
  int dimension = 0;                       // 6 * blocks + scales
  std::vector<std::pair<int, int>> chunk;  // points [begin, end)

  explicit Layout(const BundleProblem& p) {
    first.assign(p.points.size() + 1, 0);
    for (const BearingObservation& o : p.observations) ++first[static_cast<size_t>(o.point) + 1];
    for (size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    slot.assign(p.poses.size(), -1);
    for (size_t i = 0; i < p.poses.size(); ++i) {
      if (p.pose_constant.empty() || !p.pose_constant[i]) slot[i] = blocks++;
    }
    for (const OdometryScale& s : p.scales) scale_slot.push_back(s.constant ? -1 : scales++);
    dimension = 6 * blocks + scales;
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

// The pattern of the reduced system: lower block triangle, blocks of 6 x 6, (row, col) with row >= col. Poses see the
// points of their neighbours, and where a loop closes those of a few passages: each row has tables for the stretches
// that its columns lie in, none for what is between.
class BlockMatrix {
 public:
  explicit BlockMatrix(int rows) : table_of_(static_cast<size_t>(rows)) {}
  int Find(int row, int col) const {
    const size_t back = static_cast<size_t>(row - col);
    const int table = table_of_[static_cast<size_t>(row)][back / kStretch];
    return tables_[static_cast<size_t>(table)][back % kStretch];
  }
  void Add(int row, int col) {
    std::vector<int>& of_row = table_of_[static_cast<size_t>(row)];
    const size_t back = static_cast<size_t>(row - col);
    if (of_row.size() <= back / kStretch) of_row.resize(back / kStretch + 1, -1);
    int& table = of_row[back / kStretch];
    if (table < 0) {
      table = static_cast<int>(tables_.size());
      tables_.emplace_back().fill(-1);
    }
    int& index = tables_[static_cast<size_t>(table)][back % kStretch];
    if (index >= 0) return;
    index = size();
    blocks_.emplace_back(row, col);
  }
  int size() const { return static_cast<int>(blocks_.size()); }
  const std::vector<std::pair<int, int>>& blocks() const { return blocks_; }

 private:
  static constexpr size_t kStretch = 32;
  std::vector<std::vector<int>> table_of_;         // [row][(row - col) / kStretch], -1: nothing there
  std::vector<std::array<int, kStretch>> tables_;  // [(row - col) % kStretch]
  std::vector<std::pair<int, int>> blocks_;
};

// Blocks of the reduced system that a map's columns belong to.
std::vector<int> SlotsOf(const MapFactor& map, const Layout& layout) {
  std::vector<int> slots;
  for (int rig : map.rigs) slots.push_back(layout.slot[static_cast<size_t>(rig)]);
  if (map.frame >= 0) slots.push_back(layout.slot[static_cast<size_t>(map.frame)]);
  return slots;
}

BlockMatrix MakePattern(const BundleProblem& p, const Layout& layout) {
  BlockMatrix pattern(layout.blocks);
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
  if (p.map) {
    const std::vector<int> of_map = SlotsOf(*p.map, layout);
    for (int a : of_map) {
      for (int b : of_map) {
        if (b >= 0 && a > b) pattern.Add(a, b);
      }
    }
  }
  return pattern;
}

// The normal equations reduced to poses and scales, but for the poses' matrix.
struct Reduced {
  Eigen::VectorXd gradient;        // J^T r reduced
  Eigen::MatrixXd scale_columns;   // free poses by free scales
  Eigen::VectorXd scale_diagonal;  // of the free scales, which share no factor
  double cost = 0;
};

class Reducer {
 public:
  Reducer(const BundleProblem& p, int threads, const CancelToken& cancel)
      : p_(p), threads_(threads), cancel_(cancel), layout_(p), pattern_(MakePattern(p, layout_)) {}
  const Layout& layout() const { return layout_; }
  const BlockMatrix& pattern() const { return pattern_; }

  // Builds the reduced system with damping `lambda` on the points' diagonals, the poses' matrix into `matrix`. Points
  // are taken a batch at a time: first what each of them adds is computed, then every worker adds up the rows that are
  // its own, in the points' order, so that the sums do not depend on the number of threads and there is one matrix,
  // however many they are.
  Reduced Build(double lambda, BlockCholesky* matrix) {
    Reduced sum;
    matrix->SetZero();
    sum.gradient = Eigen::VectorXd::Zero(layout_.dimension);
    const int points = static_cast<int>(p_.points.size()), workers = ResolveThreads(threads_);
    for (int begin = 0, end = 0; begin < points; begin = end) {
      const int first = layout_.first[static_cast<size_t>(begin)];
      while (end < points && layout_.first[static_cast<size_t>(end) + 1] - first <= kBatch) ++end;
      end = std::max(end, begin + 1);
      terms_.resize(static_cast<size_t>(layout_.first[static_cast<size_t>(end)] - first));
      const int count = end - begin;
      std::vector<double> costs(static_cast<size_t>(count));
      ParallelFor(workers, threads_, cancel_, [&](int64_t worker) {
        const auto share = [&](int64_t w) { return static_cast<int>(w * count / workers); };
        for (int j = share(worker); j < share(worker + 1); ++j)
          costs[static_cast<size_t>(j)] = Reduce(begin + j, first, lambda);
      });
      for (double cost : costs) sum.cost += cost;
      ParallelFor(workers, threads_, cancel_, [&](int64_t worker) {
        for (int j = begin; j < end; ++j) AddPoint(j, first, static_cast<int>(worker), workers, matrix, &sum);
      });
    }
    AddFactors(matrix, &sum);
    if (p_.map) AddMap(*p_.map, matrix, &sum);
    return sum;
  }

  // Back substitution: where the points go with given pose steps. Their systems are computed again, at a fifth of what
  // keeping them from Build would need in memory.
  std::vector<Eigen::Vector3d> MovedPoints(const Eigen::VectorXd& step, double lambda) const {
    std::vector<Eigen::Vector3d> moved = p_.points;
    if (p_.points_constant) return moved;
    ParallelFor(kChunks, threads_, cancel_, [&](int64_t c) {
      const auto [begin, end] = layout_.chunk[static_cast<size_t>(c)];
      for (int j = begin; j < end; ++j) {
        Eigen::Vector3d& y = moved[static_cast<size_t>(j)];
        Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
        Eigen::Vector3d g = Eigen::Vector3d::Zero();
        for (int k = layout_.first[static_cast<size_t>(j)]; k < layout_.first[static_cast<size_t>(j) + 1]; ++k) {
          const BearingObservation& o = p_.observations[static_cast<size_t>(k)];
          ObservationTerms t;
          if (!o.active || !Evaluate<true>(p_, o, y, &t)) continue;
          double weight = 1;
          Rho(p_.loss.get(), t.r.squaredNorm(), &weight);
          const Eigen::Matrix<double, 2, 3> wjy = weight * t.jy;
          h += t.jy.transpose() * wjy;
          const int slot = layout_.slot[static_cast<size_t>(o.pose)];
          g += wjy.transpose() * (slot < 0 ? t.r : t.r + t.jp * step.segment<6>(6 * slot));
        }
        const Eigen::Vector3d by = Damped(h, lambda).ldlt().solve(g);
        if (by.allFinite()) y -= by;
      }
    });
    return moved;
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
    if (p.map) sum += 0.5 * EvaluateMap(p, *p.map).r.squaredNorm();
    for (const OdometryScale& s : p.scales) {
      if (!s.constant) sum += 0.5 * std::pow((s.value - s.prior) / s.sigma, 2);
    }
    return sum;
  }

  static Eigen::Matrix3d Damped(const Eigen::Matrix3d& h, double lambda) {
    Eigen::Matrix3d d = h;
    // A trace part keeps points without parallax (rank 2) solvable: they do not move along their ray.
    d.diagonal() += lambda * h.diagonal() + Eigen::Vector3d::Constant(1e-12 * h.trace() + 1e-300);
    return d;
  }

 private:
  // What an observation adds to the reduced system.
  struct Term {
    int slot = -1;                        // -1: nothing
    Eigen::Matrix<double, 6, 2> jp;       // transposed, times the root of its weight
    Eigen::Matrix<double, 6, 3> hpy;      // pose with point
    Eigen::Matrix<double, 6, 3> reduced;  // the same times minus the inverse of the point's block
    Eigen::Matrix<double, 6, 1> gradient;
  };

  // The point's system and its observations' terms, which begin at `first` of all observations; its cost.
  double Reduce(int point, int first, double lambda) {
    const size_t j = static_cast<size_t>(point);
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    double cost = 0;
    Term* const terms = terms_.data() - first;
    for (int k = layout_.first[j]; k < layout_.first[j + 1]; ++k) {
      const BearingObservation& o = p_.observations[static_cast<size_t>(k)];
      Term& term = terms[k];
      term.slot = -1;
      if (!o.active) continue;
      ObservationTerms t;
      double weight = 1;
      if (!Evaluate<true>(p_, o, p_.points[j], &t)) {
        cost += 0.5 * Rho(p_.loss.get(), 1e8, &weight);
        continue;
      }
      cost += 0.5 * Rho(p_.loss.get(), t.r.squaredNorm(), &weight);
      const Eigen::Matrix<double, 2, 3> wjy = weight * t.jy;
      h += t.jy.transpose() * wjy;
      g += wjy.transpose() * t.r;
      term.slot = layout_.slot[static_cast<size_t>(o.pose)];
      if (term.slot < 0) continue;
      term.jp = std::sqrt(weight) * t.jp.transpose();
      term.hpy = t.jp.transpose() * wjy;
      term.gradient = weight * t.jp.transpose() * t.r;
    }
    const Eigen::Matrix3d inverse = Damped(h, lambda).inverse();
    const bool free = !p_.points_constant && inverse.allFinite();
    const Eigen::Vector3d hg = inverse * g;
    for (int k = layout_.first[j]; k < layout_.first[j + 1]; ++k) {
      Term& term = terms[k];
      if (term.slot < 0) continue;
      if (free) {
        term.reduced = -term.hpy * inverse;
        term.gradient -= term.hpy * hg;
      } else {
        term.reduced.setZero();
      }
    }
    return cost;
  }

  // Adds what the point brings to the rows of one worker.
  void AddPoint(int point, int first, int worker, int workers, BlockCholesky* matrix, Reduced* sum) const {
    const Term* const begin = terms_.data() + (layout_.first[static_cast<size_t>(point)] - first);
    const Term* const end = terms_.data() + (layout_.first[static_cast<size_t>(point) + 1] - first);
    for (const Term* a = begin; a != end; ++a) {
      if (a->slot < 0 || a->slot % workers != worker) continue;
      matrix->Add(a->slot, a->jp, a->jp);  // diagonals come first
      sum->gradient.segment<6>(6 * a->slot) += a->gradient;
      if (p_.points_constant) continue;
      for (const Term* b = begin; b != end; ++b) {
        if (b->slot < 0 || b->slot > a->slot) continue;
        const int k = a->slot == b->slot ? a->slot : pattern_.Find(a->slot, b->slot);
        matrix->Add(k, a->reduced, b->hpy);
      }
    }
  }

  void AddFactors(BlockCholesky* matrix, Reduced* sum) const {
    const int first_scale = 6 * layout_.blocks;
    sum->scale_columns = Eigen::MatrixXd::Zero(first_scale, layout_.scales);
    sum->scale_diagonal = Eigen::VectorXd::Zero(layout_.scales);
    for (const PoseFactor& f : p_.factors) {
      FactorTerms t;
      EvaluateFactor(p_, f, &t);
      double weight = 1;
      sum->cost += 0.5 * Rho(f.loss.get(), t.r.squaredNorm(), &weight);
      const int a = layout_.slot[static_cast<size_t>(f.a)];
      const int b = f.b >= 0 ? layout_.slot[static_cast<size_t>(f.b)] : -1;
      if (a >= 0) {
        matrix->Add<6>(a, weight * t.ja.transpose(), t.ja.transpose());
        sum->gradient.segment<6>(6 * a) += weight * t.ja.transpose() * t.r;
      }
      if (b >= 0) {
        matrix->Add<6>(b, weight * t.jb.transpose(), t.jb.transpose());
        sum->gradient.segment<6>(6 * b) += weight * t.jb.transpose() * t.r;
        if (a > b) matrix->Add<6>(pattern_.Find(a, b), weight * t.ja.transpose(), t.jb.transpose());
        if (a >= 0 && a < b) matrix->Add<6>(pattern_.Find(b, a), weight * t.jb.transpose(), t.ja.transpose());
      }
      const int s = f.scale < 0 ? -1 : layout_.scale_slot[static_cast<size_t>(f.scale)];
      if (s < 0) continue;
      if (a >= 0) sum->scale_columns.block<6, 1>(6 * a, s) += weight * t.ja.transpose() * t.js;
      if (b >= 0) sum->scale_columns.block<6, 1>(6 * b, s) += weight * t.jb.transpose() * t.js;
      sum->scale_diagonal(s) += weight * t.js.squaredNorm();
      sum->gradient(first_scale + s) += weight * t.js.dot(t.r);
    }
    for (size_t k = 0; k < p_.scales.size(); ++k) {
      const int s = layout_.scale_slot[k];
      if (s < 0) continue;
      const OdometryScale& scale = p_.scales[k];
      const double e = (scale.value - scale.prior) / scale.sigma;
      sum->cost += 0.5 * e * e;
      sum->scale_diagonal(s) += 1 / (scale.sigma * scale.sigma);
      sum->gradient(first_scale + s) += e / scale.sigma;
    }
  }

  void AddMap(const MapFactor& map, BlockCholesky* matrix, Reduced* sum) const {
    const MapTerms t = EvaluateMap(p_, map);
    const Eigen::MatrixXd h = t.j.transpose() * t.j;
    const Eigen::VectorXd g = t.j.transpose() * t.r;
    const std::vector<int> slots = SlotsOf(map, layout_);
    sum->cost += 0.5 * t.r.squaredNorm();
    const Matrix6d one = Matrix6d::Identity();
    for (size_t a = 0; a < slots.size(); ++a) {
      if (slots[a] < 0) continue;
      const auto row = 6 * static_cast<Eigen::Index>(a);
      sum->gradient.segment<6>(6 * slots[a]) += g.segment<6>(row);
      for (size_t b = 0; b < slots.size(); ++b) {
        if (slots[b] < 0 || slots[b] > slots[a]) continue;
        const int k = slots[a] == slots[b] ? slots[a] : pattern_.Find(slots[a], slots[b]);
        matrix->Add<6>(k, h.block<6, 6>(row, 6 * static_cast<Eigen::Index>(b)), one);
      }
    }
  }

  const BundleProblem& p_;
  int threads_;
  const CancelToken& cancel_;
  Layout layout_;
  BlockMatrix pattern_;
  std::vector<Term> terms_;  // of a batch
};

// The reduced system, factored: blocks of poses, bordered by the free scales.
class ReducedSolver {
 public:
  ReducedSolver(const BlockMatrix& pattern, const Layout& layout, int threads)
      : threads_(threads),
        poses_(6 * layout.blocks),
        scales_(layout.scales),
        cholesky_(layout.blocks, pattern.blocks()) {}

  // What the poses' matrix is built into.
  BlockCholesky* matrix() { return &cholesky_; }
  // With relative damping of the diagonal. False if the system is not positive definite.
  bool Factorize(const Reduced& r, double lambda) {
    if (!cholesky_.Factorize(lambda, threads_)) return false;
    if (scales_ == 0) return true;
    border_ = r.scale_columns;
    for (Eigen::Index s = 0; s < scales_; ++s) cholesky_.Solve(border_.col(s));
    Eigen::MatrixXd pivot = -border_.transpose() * r.scale_columns;
    pivot.diagonal() += r.scale_diagonal * (1 + lambda);
    pivot_.compute(pivot);
    return pivot_.info() == Eigen::Success;
  }

  Eigen::VectorXd Solve(const Eigen::VectorXd& right_hand_side) const {
    Eigen::VectorXd x = right_hand_side;
    cholesky_.Solve(x.head(poses_));
    if (scales_ > 0) {
      // border_ = A^-1 B, so B^T A^-1 y = border_^T y for the right hand side y of the poses.
      const Eigen::VectorXd scales = pivot_.solve(x.tail(scales_) - border_.transpose() * right_hand_side.head(poses_));
      x.head(poses_) -= border_ * scales;
      x.tail(scales_) = scales;
    }
    return x;
  }

  // Blocks of the inverse: of the poses' matrix, and what the border adds to them.
  BlockCholesky::Inverse SelectedInverse() && { return std::move(cholesky_).SelectedInverse(threads_); }
  double ScaleVariance(Eigen::Index slot) const { return pivot_.solve(Eigen::VectorXd::Unit(scales_, slot))(slot); }
  Matrix6d BorderBlock(int a, int b) const {
    if (scales_ == 0) return Matrix6d::Zero();
    return border_.middleRows<6>(6 * a) * pivot_.solve(border_.middleRows<6>(6 * b).transpose());
  }

 private:
  int threads_;
  Eigen::Index poses_;
  Eigen::Index scales_;
  BlockCholesky cholesky_;
  Eigen::MatrixXd border_;
  Eigen::LLT<Eigen::MatrixXd> pivot_;
};

void MovePosesAndScales(const Layout& layout, const Eigen::VectorXd& step, BundleProblem* p) {
  for (size_t i = 0; i < p->poses.size(); ++i) {
    if (layout.slot[i] >= 0) p->poses[i] = p->poses[i].Plus(step.segment<6>(6 * layout.slot[i]));
  }
  for (size_t s = 0; s < p->scales.size(); ++s) {
    if (layout.scale_slot[s] >= 0) p->scales[s].value += step(6 * layout.blocks + layout.scale_slot[s]);
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
  ReducedSolver solver(reducer.pattern(), layout, options.threads);
  bool singular = false;
  double lambda = 1e-5;
  summary.initial_cost = summary.final_cost = reducer.Cost(p);
  progress.Begin("bundle adjustment", options.max_iterations);
  for (int it = 0; it < options.max_iterations; ++it) {
    summary.iterations = it + 1;
    bool accepted = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      cancel.ThrowIfCancelled();
      const Reduced reduced = reducer.Build(lambda, solver.matrix());
      singular = !solver.Factorize(reduced, lambda);
      if (singular) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      const Eigen::VectorXd step = -solver.Solve(reduced.gradient);
      if (!step.allFinite()) {
        lambda = std::max(lambda, 1e-8) * 10;
        continue;
      }
      std::vector<Eigen::Vector3d> other_points = reducer.MovedPoints(step, lambda);
      const std::vector<Rigid3d> old_poses = p.poses;
      const std::vector<OdometryScale> old_scales = p.scales;
      MovePosesAndScales(layout, step, &p);
      p.points.swap(other_points);
      const double cost = reducer.Cost(p);
      if (std::isfinite(cost) && cost <= summary.final_cost) {
        gain = summary.final_cost - cost;
        summary.final_cost = cost;
        lambda = std::max(1e-9, lambda * 0.2);
        accepted = true;
      } else {
        p.poses = old_poses;
        p.points.swap(other_points);
        p.scales = old_scales;
        lambda = std::max(lambda, 1e-8) * 8;
      }
    }
    progress.Advance(1);
    if (!accepted) {
      if (it == 0 && singular) {
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
  ReducedSolver solver;
  int threads;
  const CancelToken& cancel;
  Impl(const Reducer& reducer, int thread_count, const CancelToken& cancel_token)
      : layout(reducer.layout()),
        solver(reducer.pattern(), layout, thread_count),
        threads(thread_count),
        cancel(cancel_token) {}
};

BundleCovariance::BundleCovariance(const BundleProblem& problem, int threads, const CancelToken& cancel) {
  Reducer reducer(problem, threads, cancel);
  impl_ = std::make_unique<Impl>(reducer, threads, cancel);
  if (!impl_->solver.Factorize(reducer.Build(0, impl_->solver.matrix()), 0)) {
    throw NumericError("covariance: the system is singular; something is not fixed by the data");
  }
}

BundleCovariance::~BundleCovariance() = default;

double BundleCovariance::ScaleVariance(int scale) const {
  const int slot = impl_->layout.scale_slot[static_cast<size_t>(scale)];
  return slot < 0 ? 0 : impl_->solver.ScaleVariance(slot);
}

Eigen::MatrixXd BundleCovariance::Joint(const std::vector<int>& poses) const {
  const auto slot = [&](size_t i) { return impl_->layout.slot[static_cast<size_t>(poses[i])]; };
  const Eigen::Index n = 6 * static_cast<Eigen::Index>(poses.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  ParallelFor(n, impl_->threads, impl_->cancel, [&](int64_t column) {
    const int own = slot(static_cast<size_t>(column / 6));
    if (own < 0) return;
    Eigen::VectorXd x = Eigen::VectorXd::Zero(impl_->layout.dimension);
    x(6 * own + column % 6) = 1;
    x = impl_->solver.Solve(x);
    for (size_t i = 0; i < poses.size(); ++i) {
      if (slot(i) >= 0) out.block<6, 1>(6 * static_cast<Eigen::Index>(i), column) = x.segment<6>(6 * slot(i));
    }
  });
  return out;
}

Eigen::MatrixXd BundleCovariance::Times(const Eigen::MatrixXd& b) const {
  const std::vector<int>& slot = impl_->layout.slot;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(b.rows(), b.cols());
  ParallelFor(b.cols(), impl_->threads, impl_->cancel, [&](int64_t column) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(impl_->layout.dimension);
    for (size_t p = 0; p < slot.size(); ++p) {
      if (slot[p] >= 0) x.segment<6>(6 * slot[p]) = b.block<6, 1>(6 * static_cast<Eigen::Index>(p), column);
    }
    x = impl_->solver.Solve(x);
    for (size_t p = 0; p < slot.size(); ++p) {
      if (slot[p] >= 0) out.block<6, 1>(6 * static_cast<Eigen::Index>(p), column) = x.segment<6>(6 * slot[p]);
    }
  });
  return out;
}

void BundleCovariance::PoseBlocks(const std::vector<int>& next, std::vector<Matrix6d>* diagonal,
                                  std::vector<Matrix6d>* with_next) && {
  const Layout& layout = impl_->layout;
  const BlockCholesky::Inverse inverse = std::move(impl_->solver).SelectedInverse();
  const auto block = [&](int a, int b) -> Matrix6d { return inverse.Block(a, b) + impl_->solver.BorderBlock(a, b); };
  const size_t poses = layout.slot.size();
  diagonal->assign(poses, Matrix6d::Zero());
  with_next->assign(poses, Matrix6d::Zero());
  for (size_t p = 0; p < poses; ++p) {
    const int slot = layout.slot[p];
    if (slot < 0) continue;
    (*diagonal)[p] = block(slot, slot);
    if (p < next.size() && next[p] >= 0 && layout.slot[static_cast<size_t>(next[p])] >= 0) {
      (*with_next)[p] = block(slot, layout.slot[static_cast<size_t>(next[p])]);
    }
  }
}

}  // namespace trigpoint
