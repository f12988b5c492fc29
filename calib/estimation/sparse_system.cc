#include "calib/estimation/sparse_system.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/base/parallel.h"

namespace trigpoint {
namespace {

constexpr int kChunks = 8;             // of points, fixed, so that sums do not depend on the number of threads
constexpr int kBatch = 16384;          // observations whose terms are held at a time
constexpr int64_t kFactorBatch = 256;  // factors that a thread takes at a time
constexpr double kBehind = 1e8;        // |r|^2 of a point behind its view: a step there never looks cheap
constexpr double kOpen = 1e-9;         // information of what nothing determines, where that is allowed
// Damping adds to every direction the same part of the equations' diagonal. In a map of 1,000 m that is held at its
// ends the weakest directions have about 4e-11 of it: they converge only when damping falls below that.
constexpr double kLeastDamping = 1e-15;  // rounding is about as much
constexpr double kLittle = 1e-8;         // below it, refused damping rises faster each time
constexpr double kRise = 8;              // of damping, when a step is refused
constexpr double kFall = 0.2;            // when a step is taken
constexpr double kFallNear = 0.02;       // when the cost also fell as predicted, near the minimum
constexpr double kAgreement = 0.05;      // part of the predicted fall, for that
constexpr double kMostDamped = 0.5;      // part of a step's decrement that may be due to damping at the end

double Rho(const ceres::LossFunction* loss, double s, double* weight) {
  double rho[3] = {s, 1, 0};
  if (loss != nullptr) loss->Evaluate(s, rho);
  *weight = rho[1];
  return rho[0];
}

void EvaluatePoint(const SparseProblem& problem, int point, bool with_jacobians, std::vector<PointTerm>* terms) {
  const auto j = static_cast<size_t>(point);
  terms->resize(static_cast<size_t>(problem.first_observation[j + 1] - problem.first_observation[j]));
  problem.EvaluatePoint(point, with_jacobians, terms->data());
}

// Points in chunks of about equal numbers of observations.
std::vector<std::pair<int, int>> Chunks(const std::vector<int>& first_observation) {
  std::vector<std::pair<int, int>> chunks;
  const int n = static_cast<int>(first_observation.size()) - 1;
  for (int c = 0, begin = 0; c < kChunks; ++c) {
    const int64_t target = static_cast<int64_t>(first_observation.back()) * (c + 1) / kChunks;
    int end = begin;
    while (end < n && (first_observation[static_cast<size_t>(end)] < target || c == kChunks - 1)) ++end;
    chunks.emplace_back(begin, end);
    begin = end;
  }
  return chunks;
}

}  // namespace

PointEquations LinearisePoint(const SparseProblem& problem, int point, std::vector<PointTerm>* terms) {
  PointEquations e;
  EvaluatePoint(problem, point, true, terms);
  for (PointTerm& t : *terms) {
    if (t.state != PointTerm::State::kSeen) continue;
    double weight = 1;
    if (t.loss != nullptr) Rho(t.loss, t.r.squaredNorm(), &weight);
    const double root = std::sqrt(weight);
    t.r *= root, t.jp *= root, t.jy *= root;
    e.hessian += t.jy.transpose() * t.jy;
    e.gradient += t.jy.transpose() * t.r;
  }
  return e;
}

double PointCost(const SparseProblem& problem, int point, std::vector<PointTerm>* terms) {
  EvaluatePoint(problem, point, false, terms);
  double cost = 0, weight = 1;
  for (const PointTerm& t : *terms) {
    if (t.state == PointTerm::State::kUnused) continue;
    cost += 0.5 * Rho(t.loss, t.state == PointTerm::State::kSeen ? t.r.squaredNorm() : kBehind, &weight);
  }
  return cost;
}

Eigen::Matrix3d Damped(const Eigen::Matrix3d& hessian, double damping) {
  Eigen::Matrix3d d = hessian;
  d.diagonal() += damping * hessian.diagonal() + Eigen::Vector3d::Constant(1e-12 * hessian.trace() + 1e-300);
  return d;
}

SparseSystem::Pattern::Pattern(const SparseProblem& problem, const FactorLayout& factors)
    : table_of_(static_cast<size_t>(problem.Blocks())) {
  for (int b = 0; b < problem.Blocks(); ++b) Add(b, b);
  std::vector<int> together;
  for (int j = 0; j < problem.Points() && !problem.points_constant; ++j) {
    together.clear();
    const int end = problem.first_observation[static_cast<size_t>(j) + 1];
    for (int k = problem.first_observation[static_cast<size_t>(j)]; k < end; ++k) {
      together.push_back(problem.ObservationBlock(k));
    }
    AddAll(&together);
  }
  for (size_t f = 0; f < factors.size(); ++f) {
    together.assign(factors.blocks.begin() + static_cast<std::ptrdiff_t>(factors.block[f]),
                    factors.blocks.begin() + static_cast<std::ptrdiff_t>(factors.block[f + 1]));
    AddAll(&together);
  }
}

void SparseSystem::Pattern::AddAll(std::vector<int>* blocks) {
  std::sort(blocks->begin(), blocks->end());
  blocks->erase(std::unique(blocks->begin(), blocks->end()), blocks->end());
  for (size_t a = 0; a < blocks->size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      if ((*blocks)[b] >= 0) Add((*blocks)[a], (*blocks)[b]);
    }
  }
}

void SparseSystem::Pattern::Add(int row, int column) {
  std::vector<int>& of_row = table_of_[static_cast<size_t>(row)];
  const auto back = static_cast<size_t>(row - column);
  if (of_row.size() <= back / kStretch) of_row.resize(back / kStretch + 1, -1);
  int& table = of_row[back / kStretch];
  if (table < 0) {
    table = static_cast<int>(tables_.size());
    tables_.emplace_back().fill(-1);
  }
  int& index = tables_[static_cast<size_t>(table)][back % kStretch];
  if (index >= 0) return;
  index = static_cast<int>(blocks_.size());
  blocks_.emplace_back(row, column);
}

int SparseSystem::Pattern::Find(int row, int column) const {
  const auto back = static_cast<size_t>(row - column);
  const int table = table_of_[static_cast<size_t>(row)][back / kStretch];
  return tables_[static_cast<size_t>(table)][back % kStretch];
}

SparseSystem::FactorLayout::FactorLayout(const SparseProblem& problem) {
  for (int f = 0; f < problem.Factors(); ++f) {
    problem.AppendFactorBlocks(f, &blocks);
    const auto rows = static_cast<size_t>(problem.FactorRows(f));
    const auto free = std::count_if(blocks.begin() + static_cast<std::ptrdiff_t>(block.back()), blocks.end(),
                                    [](int of_unknown) { return of_unknown >= 0; });
    block.push_back(blocks.size());
    residual.push_back(residual.back() + rows);
    jacobian.push_back(jacobian.back() + 6 * rows * static_cast<size_t>(free));
  }
}

SparseSystem::SparseSystem(const SparseProblem& problem)
    : factors_(problem),
      residuals_(factors_.residual.back(), 0),
      jacobians_(factors_.jacobian.back(), 0),
      weights_(factors_.size(), 1),
      costs_(factors_.size(), 0),
      chunks_(Chunks(problem.first_observation)),
      pattern_(problem, factors_),
      matrix_(problem.Blocks(), pattern_.blocks()) {}

double SparseSystem::EvaluateFactors(const SparseProblem& problem, bool with_jacobians, const Workers& workers) {
  const auto count = static_cast<int64_t>(weights_.size());
  ParallelFor((count + kFactorBatch - 1) / kFactorBatch, workers.threads, workers.cancel, [&](int64_t batch) {
    std::vector<double*> jacobians;
    for (int64_t n = batch * kFactorBatch; n < std::min(count, (batch + 1) * kFactorBatch); ++n) {
      const auto f = static_cast<size_t>(n);
      const size_t rows = factors_.residual[f + 1] - factors_.residual[f];
      double* at = jacobians_.data() + factors_.jacobian[f];
      jacobians.clear();
      for (size_t k = factors_.block[f]; k < factors_.block[f + 1]; ++k) {
        const bool wanted = with_jacobians && factors_.blocks[k] >= 0;
        jacobians.push_back(wanted ? at : nullptr);
        if (wanted) at += 6 * rows;
      }
      double* const residual = residuals_.data() + factors_.residual[f];
      if (!problem.EvaluateFactor(static_cast<int>(f), residual, jacobians.data())) {
        costs_[f] = std::numeric_limits<double>::infinity();
        continue;
      }
      const double square = Eigen::Map<const Eigen::VectorXd>(residual, static_cast<Eigen::Index>(rows)).squaredNorm();
      costs_[f] = 0.5 * Rho(problem.FactorLoss(static_cast<int>(f)), square, &weights_[f]);
    }
  });
  double cost = 0;
  for (double c : costs_) cost += c;
  return cost;
}

SparseSystem::FactorTerms SparseSystem::Factor(int factor) const {
  const auto f = static_cast<size_t>(factor);
  const auto rows = static_cast<Eigen::Index>(factors_.residual[f + 1] - factors_.residual[f]);
  FactorTerms terms{weights_[f], {residuals_.data() + factors_.residual[f], rows}, {}};
  const double* at = jacobians_.data() + factors_.jacobian[f];
  for (size_t k = factors_.block[f]; k < factors_.block[f + 1]; ++k) {
    if (factors_.blocks[k] < 0) continue;
    terms.jacobians.emplace_back(factors_.blocks[k],
                                 Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(at, 6, rows));
    at += 6 * rows;
  }
  return terms;
}

double SparseSystem::Cost(const SparseProblem& problem, const Workers& workers) {
  std::vector<double> parts(chunks_.size(), 0.0);
  if (problem.Points() > 0) {
    ParallelFor(kChunks, workers.threads, workers.cancel, [&](int64_t c) {
      const auto [begin, end] = chunks_[static_cast<size_t>(c)];
      std::vector<PointTerm> terms;
      for (int j = begin; j < end; ++j) parts[static_cast<size_t>(c)] += PointCost(problem, j, &terms);
    });
  }
  double cost = 0;
  for (double part : parts) cost += part;
  return cost + EvaluateFactors(problem, false, workers);
}

void SparseSystem::Build(const SparseProblem& problem, double damping, const Workers& workers) {
  matrix_.SetZero();
  gradient_ = Eigen::VectorXd::Zero(6 * problem.Blocks());
  for (int b = 0; b < problem.Blocks(); ++b) {
    matrix_.Diagonal(b).tail(6 - problem.tangents[static_cast<size_t>(b)]).setOnes();
  }
  BuildPoints(problem, damping, workers);
  EvaluateFactors(problem, true, workers);
  const int rows = ResolveThreads(workers.threads);
  ParallelFor(rows, workers.threads, workers.cancel,
              [&](int64_t worker) { AddFactors(static_cast<int>(worker), rows); });
}

// Points are taken a batch at a time: first what each of them adds is computed, then every worker adds up the rows that
// are its own, in the points' order, so that the sums do not depend on the number of threads and there is one matrix,
// however many they are.
void SparseSystem::BuildPoints(const SparseProblem& problem, double damping, const Workers& workers) {
  const std::vector<int>& first = problem.first_observation;
  const int count = ResolveThreads(workers.threads);
  std::vector<Term> terms;
  for (int begin = 0, end = 0; begin < problem.Points(); begin = end) {
    const int from = first[static_cast<size_t>(begin)];
    while (end < problem.Points() && first[static_cast<size_t>(end) + 1] - from <= kBatch) ++end;
    end = std::max(end, begin + 1);
    terms.resize(static_cast<size_t>(first[static_cast<size_t>(end)] - from));
    const auto terms_of = [&](int j) { return terms.data() + (first[static_cast<size_t>(j)] - from); };
    ParallelFor(count, workers.threads, workers.cancel, [&](int64_t worker) {
      std::vector<PointTerm> buffer;
      const auto share = [&](int64_t w) { return begin + static_cast<int>(w * (end - begin) / count); };
      for (int j = share(worker); j < share(worker + 1); ++j) ReducePoint(problem, j, damping, &buffer, terms_of(j));
    });
    ParallelFor(count, workers.threads, workers.cancel, [&](int64_t worker) {
      for (int j = begin; j < end; ++j) {
        AddPoint(problem.points_constant, terms_of(j), terms_of(j + 1), static_cast<int>(worker), count);
      }
    });
  }
}

void SparseSystem::ReducePoint(const SparseProblem& problem, int point, double damping, std::vector<PointTerm>* buffer,
                               Term* terms) const {
  const PointEquations e = LinearisePoint(problem, point, buffer);
  const Eigen::Matrix3d inverse = Damped(e.hessian, damping).inverse();
  const bool free = !problem.points_constant && inverse.allFinite();
  const Eigen::Vector3d shift = inverse * e.gradient;
  for (const PointTerm& t : *buffer) {
    Term& term = *terms++;
    term.block = t.state == PointTerm::State::kSeen ? t.block : -1;
    if (term.block < 0) continue;
    term.jp = t.jp.transpose();
    term.gradient = t.jp.transpose() * t.r;
    term.mixed = t.jp.transpose() * t.jy;
    if (free) {
      term.reduced = -term.mixed * inverse;
      term.gradient -= term.mixed * shift;
    } else {
      term.reduced.setZero();
    }
  }
}

// What a point brings to the rows of one worker.
void SparseSystem::AddPoint(bool constant, const Term* begin, const Term* end, int worker, int workers) {
  for (const Term* a = begin; a != end; ++a) {
    if (a->block < 0 || a->block % workers != worker) continue;
    matrix_.Add(a->block, a->jp, a->jp);  // diagonals come first
    gradient_.segment<6>(6 * a->block) += a->gradient;
    if (constant) continue;
    for (const Term* b = begin; b != end; ++b) {
      if (b->block < 0 || b->block > a->block) continue;
      matrix_.Add(a->block == b->block ? a->block : pattern_.Find(a->block, b->block), a->reduced, b->mixed);
    }
  }
}

void SparseSystem::AddFactors(int worker, int workers) {
  Eigen::Matrix<double, 6, Eigen::Dynamic> weighted;
  for (size_t f = 0; f < weights_.size(); ++f) {
    const FactorTerms terms = Factor(static_cast<int>(f));
    const auto rows = static_cast<int>(terms.residual.size());
    for (const auto& [a, ja] : terms.jacobians) {
      if (a % workers != worker) continue;
      weighted = terms.weight * ja;
      gradient_.segment<6>(6 * a).noalias() += weighted * terms.residual;
      for (const auto& [b, jb] : terms.jacobians) {
        if (b <= a) matrix_.Add(a == b ? a : pattern_.Find(a, b), weighted.data(), jb.data(), rows);
      }
    }
  }
}

bool SparseSystem::Factorize(const SparseProblem& problem, double damping, const Workers& workers) {
  for (int b = 0; b < problem.Blocks() && problem.least_diagonal > 0; ++b) {
    matrix_.Diagonal(b) = matrix_.Diagonal(b).cwiseMax(problem.least_diagonal).eval();
  }
  diagonal_.resize(6 * problem.Blocks());
  for (int b = 0; b < problem.Blocks(); ++b) diagonal_.segment<6>(6 * b) = matrix_.Diagonal(b);
  return matrix_.Factorize(damping, workers.threads);
}

bool SparseSystem::Linearise(const SparseProblem& problem, bool open, const Workers& workers) {
  Build(problem, 0, workers);
  if (matrix_.Factorize(0, workers.threads)) return true;
  if (!open) return false;
  Build(problem, 0, workers);
  for (int b = 0; b < problem.Blocks(); ++b) {
    matrix_.Diagonal(b) += kOpen * matrix_.Diagonal(b).cwiseMax(1.0).eval();
  }
  return matrix_.Factorize(0, workers.threads);
}

SparseSystem::Step SparseSystem::SolveStep(const SparseProblem& problem, double damping, const Workers& workers) const {
  Step step;
  step.blocks = -gradient_;
  matrix_.Solve(step.blocks);
  step.decrement = -gradient_.dot(step.blocks);
  step.by_damping = damping * diagonal_.dot(step.blocks.cwiseAbs2());
  if (!problem.points_constant && problem.Points() > 0) MovePoints(problem, damping, workers, &step);
  return step;
}

// The points' equations are computed again, at a fifth of what keeping them from Build would need in memory.
void SparseSystem::MovePoints(const SparseProblem& problem, double damping, const Workers& workers, Step* step) const {
  std::vector<double> decrements(chunks_.size(), 0.0), by_damping(chunks_.size(), 0.0);
  step->points.assign(static_cast<size_t>(problem.Points()), Eigen::Vector3d::Zero());
  step->carriers.assign(static_cast<size_t>(problem.Points()), -1);
  ParallelFor(kChunks, workers.threads, workers.cancel, [&](int64_t c) {
    std::vector<PointTerm> terms;
    const auto [begin, end] = chunks_[static_cast<size_t>(c)];
    for (int j = begin; j < end; ++j) {
      PointEquations e = LinearisePoint(problem, j, &terms);
      const Eigen::Matrix3d damped = Damped(e.hessian, damping);
      const Eigen::LDLT<Eigen::Matrix3d> ldlt(damped);
      const double alone = e.gradient.dot(ldlt.solve(e.gradient));  // with the blocks held
      for (const PointTerm& t : terms) {
        if (t.state != PointTerm::State::kSeen || t.block < 0) continue;
        if (int& carrier = step->carriers[static_cast<size_t>(j)]; carrier < 0) carrier = t.block;
        e.gradient += t.jy.transpose() * (t.jp * step->blocks.segment<6>(6 * t.block));
      }
      const Eigen::Vector3d by = ldlt.solve(e.gradient);
      if (!by.allFinite() || !std::isfinite(alone)) continue;
      step->points[static_cast<size_t>(j)] = -by;
      decrements[static_cast<size_t>(c)] += alone;
      by_damping[static_cast<size_t>(c)] += by.dot((damped - e.hessian) * by);
    }
  });
  for (size_t c = 0; c < chunks_.size(); ++c) step->decrement += decrements[c], step->by_damping += by_damping[c];
}

namespace {

struct Attempt {
  bool factorised = false, stepped = false, accepted = false;
  bool damped = false;   // damping shortens the step much
  double decrement = 0;  // SparseSystem::Step
  double gain = 0;       // by how much the cost fell, as a part of what the equations predict
};

// Moves points and blocks by `far` times the step: points from `from`, blocks from where they are.
void Move(SparseProblem* problem, const SparseSystem::Step& step, double far, const std::vector<Eigen::Vector3d>& from,
          const Workers& workers) {
  constexpr size_t kAtATime = 4096;
  std::vector<Eigen::Vector3d>& to = problem->PointPositions();
  const size_t count = step.points.size();
  ParallelFor(static_cast<int64_t>((count + kAtATime - 1) / kAtATime), workers.threads, workers.cancel, [&](int64_t k) {
    const size_t begin = static_cast<size_t>(k) * kAtATime;
    for (size_t j = begin; j < std::min(count, begin + kAtATime); ++j) {
      const int carrier = step.carriers[j];
      const Eigen::Vector3d by = far * step.points[j];
      to[j] = carrier < 0 ? from[j] + by
                          : problem->MovedAlong(carrier, far * step.blocks.segment<6>(6 * carrier), from[j], by);
    }
  });
  problem->Step(far * step.blocks);
}

// By how much to multiply a step that made the cost fall by `fall`: the parabola through the cost before and after it
// is least there. Where many residuals have small robust weights, the equations take the cost as more curved than it
// is.
double Farther(const SparseSystem::Step& step, double fall) {
  constexpr double kFarthest = 4;
  const double missing = step.decrement - fall;  // half of the curvature along the step
  return 2 * kFarthest * missing > step.decrement ? 0.5 * step.decrement / missing : kFarthest;
}

// Takes a step with the given damping if that does not make the cost worse.
Attempt TryStep(SparseProblem* problem, SparseSystem* system, double damping, const Workers& workers, double* cost) {
  constexpr double kWorthwhile = 1.25;
  Attempt attempt;
  system->Build(*problem, damping, workers);
  attempt.factorised = system->Factorize(*problem, damping, workers);
  if (!attempt.factorised) return attempt;
  const SparseSystem::Step step = system->SolveStep(*problem, damping, workers);
  attempt.stepped = step.blocks.allFinite();
  if (!attempt.stepped) return attempt;
  attempt.decrement = step.decrement;
  attempt.damped = step.by_damping > kMostDamped * step.decrement;
  std::vector<Eigen::Vector3d> from = problem->PointPositions();
  Move(problem, step, 1, from, workers);
  const double fresh = system->Cost(*problem, workers), fall = *cost - fresh;
  attempt.accepted = std::isfinite(fresh) && fall >= 0;
  attempt.gain = fall / std::max(step.PredictedFall(), std::numeric_limits<double>::min());
  if (!attempt.accepted) {
    problem->Undo();
    problem->PointPositions().swap(from);
    return attempt;
  }
  *cost = fresh;
  const double farther = Farther(step, fall);
  if (farther < kWorthwhile) return attempt;
  problem->Undo();
  Move(problem, step, farther, from, workers);
  const double there = system->Cost(*problem, workers);
  if (there < fresh) {
    *cost = there;
  } else {
    problem->Undo();
    Move(problem, step, 1, from, workers);
  }
  return attempt;
}

// Of the next step's damping, after one that was taken (Nielsen, "Damping parameter in Marquardt's method", 1999).
// Where the cost fell as much as predicted, damping is of no use any more, unless the same step with less was refused.
double FactorNearMinimum(double gain, bool refused_before) {
  if (!refused_before && gain > 1 - kAgreement) return kFallNear;
  return std::max(kFall, 1 - std::pow(2 * gain - 1, 3));
}

}  // namespace

SparseSummary Minimise(SparseProblem* problem, SparseSystem* system, const SparseOptions& options,
                       const Workers& workers, ProgressSink& progress) {
  constexpr int kMaxAttempts = 8;
  SparseSummary s;
  double damping = options.damping, least = kLeastDamping;
  bool factorised = false;
  s.initial_cost = s.final_cost = system->Cost(*problem, workers);
  s.singular = !std::isfinite(s.initial_cost);
  if (s.singular) return s;
  for (int it = 0; it < options.max_iterations && !s.converged; ++it) {
    ++s.iterations;
    const double before = s.final_cost;
    Attempt attempt;
    for (int k = 0; k < kMaxAttempts && !attempt.accepted && !s.converged; ++k) {
      workers.cancel.ThrowIfCancelled();
      attempt = TryStep(problem, system, damping, workers, &s.final_cost);
      attempt.damped &= damping > least;
      factorised |= attempt.factorised;
      if (attempt.accepted) {
        const double factor = damping < options.damping ? FactorNearMinimum(attempt.gain, k > 0) : kFall;
        damping = std::max(least, factor * damping);
      } else {
        if (!attempt.factorised) least = std::max(least, 10 * damping);
        damping *= damping < kLittle ? std::pow(kRise, k + 1) : kRise;
      }
      s.converged = attempt.stepped && !attempt.damped && attempt.decrement < options.distance_tolerance;
    }
    progress.Advance(1);
    s.singular = !factorised;
    if (s.singular) return s;
    // Where no step makes the cost better, this is as far as rounding lets it come.
    const bool little = before - s.final_cost < options.relative_cost_tolerance * s.final_cost;
    s.converged |= !attempt.accepted || (little && !attempt.damped);
  }
  return s;
}

}  // namespace trigpoint
