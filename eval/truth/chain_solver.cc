#include "eval/truth/chain_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/base/error.h"
#include "eval/truth/selected_inverse.h"

namespace trigpoint {
namespace {

using Triplet = Eigen::Triplet<double>;
using Matrix61d = Eigen::Matrix<double, 6, 1>;

struct MotionTerms {
  Vector6d r;
  Matrix6d by_a = Matrix6d::Zero(), by_b = Matrix6d::Zero();
  Matrix61d by_scale = Matrix61d::Zero();
};

MotionTerms Linearize(const ChainMotion& m, const ChainProblem& p) {
  const Rigid3d& a = p.bodies[static_cast<size_t>(m.a)];
  const Rigid3d& b = p.bodies[static_cast<size_t>(m.b)];
  const Eigen::Matrix3d ra = a.rotation.conjugate().toRotationMatrix();
  const Eigen::Matrix3d rb = b.rotation.conjugate().toRotationMatrix();
  const double wr = 1 / (m.sigma_rot_rad * p.motion_rot_factor), wt = 1 / (m.sigma_m * p.motion_m_factor);
  MotionTerms terms;
  const Eigen::Vector3d e = LogSO3(m.a_from_b.rotation.conjugate() * (a.rotation.conjugate() * b.rotation));
  const Eigen::Matrix3d right_inverse = LeftJacobianInverseSO3(-e);  // Jr(e) = Jl(-e)
  const Eigen::Vector3d step = b.translation - a.translation;
  terms.r << wr * e, wt * (ra * step - p.scale * m.a_from_b.translation);
  terms.by_b.topLeftCorner<3, 3>() = wr * right_inverse * rb;
  terms.by_a.topLeftCorner<3, 3>() = -wr * right_inverse * rb;
  terms.by_a.bottomLeftCorner<3, 3>() = wt * ra * Skew(step);
  terms.by_a.bottomRightCorner<3, 3>() = -wt * ra;
  terms.by_b.bottomRightCorner<3, 3>() = wt * ra;
  terms.by_scale.tail<3>() = -wt * m.a_from_b.translation;
  return terms;
}

class Solver {
 public:
  Solver(ChainProblem* problem, const ChainOptions& options, const CancelToken& cancel)
      : p_(*problem),
        options_(options),
        cancel_(cancel),
        map_(problem->tags),
        returned_(problem->sights.size(), false) {
    int at = 0;
    for (size_t i = 0; i < p_.bodies.size(); ++i) body_at_.push_back(p_.free[i] ? std::exchange(at, at + 6) : -1);
    tags_at_ = at;
    scale_at_ = tags_at_ + 6 * static_cast<int>(p_.tags.size());
    size_ = scale_at_ + 1;
    const Eigen::LLT<Eigen::MatrixXd> llt(p_.tag_covariance);
    if (llt.info() != Eigen::Success) {
      throw NumericError("the tag map's covariance is not positive definite; survey again");
    }
    tag_information_ = llt.solve(Eigen::MatrixXd::Identity(p_.tag_covariance.rows(), p_.tag_covariance.cols()));
  }

  int Iterate(bool robust) {
    double lambda = 1e-6, cost = Cost(robust);
    int iterations = 0;
    for (; iterations < options_.max_iterations; ++iterations) {
      cancel_.ThrowIfCancelled();
      Eigen::VectorXd gradient;
      const Eigen::SparseMatrix<double> normal = Normal(robust, &gradient);
      bool better = false;
      double gain = 0;
      for (int tries = 0; tries < 8 && !better; ++tries, lambda *= 10) {
        Eigen::SparseMatrix<double> damped = normal;
        for (int i = 0; i < size_; ++i) damped.coeffRef(i, i) *= 1 + lambda;
        const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> llt(damped);
        if (llt.info() != Eigen::Success) continue;
        const ChainProblem before = p_;
        Apply(llt.solve(-gradient));
        const double now = Cost(robust);
        better = now <= cost;
        if (better) {
          gain = cost - now;
          cost = now;
          lambda = std::max(1e-12, lambda * 1e-3);
        } else {
          p_.bodies = before.bodies;
          p_.tags = before.tags;
          p_.scale = before.scale;
        }
      }
      if (!better || gain < 1e-9 * (1 + cost)) break;
    }
    cost_ = cost;
    return iterations;
  }

  SelectedInverse Covariance() {
    Eigen::VectorXd gradient;
    return SelectedInverse(Normal(false, &gradient));
  }

  // Data snooping by standardised residuals. A sight that is wrong pulls its neighbours along the chain with it, so
  // that of those nearby only the worst is rejected at a time; one that was rejected and agrees with the solution
  // made without it comes back. True if anything changed.
  bool Snoop(const SelectedInverse& covariance) {
    constexpr int kNearby = 20;  // bodies
    constexpr double kMuchWorse = 4;
    bool changed = false;
    std::vector<std::pair<double, size_t>> bad;
    for (size_t i = 0; i < p_.sights.size(); ++i) {
      ChainSight& s = p_.sights[i];
      if (!p_.free[static_cast<size_t>(s.body)]) continue;
      Eigen::Matrix<double, 8, 12> j;
      const Vector8d r = Residual(s, &j);
      // Covariance of the residual: 1 - J C J', never below a tenth of the stated noise; 1 + J C J' of one left out.
      const double side = s.rejected ? 1 : -1;
      const Eigen::Matrix<double, 8, 8> q = (s.rejected ? 1 : 1.1) * Eigen::Matrix<double, 8, 8>::Identity() +
                                            side * j * Joint(s, covariance) * j.transpose();
      const double chi2 = r.dot(q.ldlt().solve(r));
      if (s.rejected) {
        if (chi2 > options_.gate_chi2 || returned_[i]) continue;
        s.rejected = false;
        returned_[i] = changed = true;
      } else if (chi2 > options_.gate_chi2) {
        bad.emplace_back(chi2, i);
      }
    }
    std::sort(bad.begin(), bad.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<std::pair<double, int>> worse;  // rejected now, with their bodies
    for (const auto& [chi2, i] : bad) {
      ChainSight& s = p_.sights[i];
      const bool overshadowed = std::any_of(worse.begin(), worse.end(), [&, chi2 = chi2](const auto& w) {
        return std::abs(w.second - s.body) <= kNearby && w.first > kMuchWorse * chi2;
      });
      if (overshadowed) continue;
      s.rejected = changed = true;
      worse.emplace_back(chi2, s.body);
    }
    return changed;
  }

  // One round of variance components; true if a factor changed by more than one percent.
  bool UpdateFactors(const SelectedInverse& covariance) {
    double square[3] = {0, 0, 0}, redundancy[3] = {0, 0, 0};
    for (const ChainSight& s : p_.sights) {
      if (s.rejected) continue;
      Eigen::Matrix<double, 8, 12> j;
      const Vector8d r = Residual(s, &j);
      square[0] += Weight(r.squaredNorm(), true) * r.squaredNorm();  // a gross error is none of the noise
      redundancy[0] += 8 - (j * Joint(s, covariance) * j.transpose()).trace();
    }
    for (const ChainMotion& m : p_.motions) {
      if (body_at_[static_cast<size_t>(m.a)] < 0 || body_at_[static_cast<size_t>(m.b)] < 0) continue;
      const MotionTerms terms = Linearize(m, p_);
      Eigen::Matrix<double, 6, 13> j;
      j << terms.by_a, terms.by_b, terms.by_scale;
      const int at[2] = {body_at_[static_cast<size_t>(m.a)], body_at_[static_cast<size_t>(m.b)]};
      Eigen::Matrix<double, 13, 13> c;
      for (int x = 0; x < 2; ++x) {
        for (int y = 0; y < 2; ++y) c.block<6, 6>(6 * x, 6 * y) = covariance.Block(at[x], at[y], 6, 6);
        c.block<6, 1>(6 * x, 12) = covariance.Block(at[x], scale_at_, 6, 1);
        c.block<1, 6>(12, 6 * x) = c.block<6, 1>(6 * x, 12).transpose();
      }
      c(12, 12) = covariance.At(scale_at_, scale_at_);
      const Matrix6d q = j * c * j.transpose();
      square[1] += terms.r.head<3>().squaredNorm();
      square[2] += terms.r.tail<3>().squaredNorm();
      redundancy[1] += 3 - q.topLeftCorner<3, 3>().trace();
      redundancy[2] += 3 - q.bottomRightCorner<3, 3>().trace();
    }
    double* const factors[3] = {&p_.corner_factor, &p_.motion_rot_factor, &p_.motion_m_factor};
    bool changed = false;
    for (int k = 0; k < 3; ++k) {
      if (redundancy[k] < 10) continue;  // too little says too little
      const double before = *factors[k];
      *factors[k] *= std::clamp(std::sqrt(square[k] / redundancy[k]), 0.1, 10.0);
      if (k == 0) *factors[k] = std::max(1.0, *factors[k]);
      changed |= std::abs(*factors[k] / before - 1) > 0.01;
    }
    return changed;
  }

  void Finish(const SelectedInverse& covariance, ChainSolution* solution) {
    for (ChainSight& s : p_.sights) s.rms_px = ResidualPx(s.sight, Raw(s, nullptr, nullptr));
    for (size_t i = 0; i < p_.bodies.size(); ++i) {
      const int at = body_at_[i];
      solution->body_covariance.push_back(at < 0 ? Matrix6d(Matrix6d::Zero())
                                                 : Matrix6d(covariance.Block(at, at, 6, 6)));
    }
    solution->scale_sigma = std::sqrt(covariance.At(scale_at_, scale_at_));
    solution->cost = cost_;
  }

 private:
  Vector8d Raw(const ChainSight& s, Matrix86d* by_body, Matrix86d* by_tag) const {
    return TagResidual(s.sight, s.size_m, s.cam_from_body, p_.bodies[static_cast<size_t>(s.body)],
                       p_.tags[static_cast<size_t>(s.tag)], by_body, by_tag);
  }
  Vector8d Residual(const ChainSight& s, Eigen::Matrix<double, 8, 12>* j) const {
    Matrix86d by_body, by_tag;
    const Vector8d r = Raw(s, &by_body, &by_tag) / p_.corner_factor;
    *j << by_body / p_.corner_factor, by_tag / p_.corner_factor;
    return r;
  }
  Eigen::Matrix<double, 12, 12> Joint(const ChainSight& s, const SelectedInverse& covariance) const {
    const int body = body_at_[static_cast<size_t>(s.body)], tag = tags_at_ + 6 * s.tag;
    Eigen::Matrix<double, 12, 12> c;
    c.topLeftCorner<6, 6>() = covariance.Block(body, body, 6, 6);
    c.topRightCorner<6, 6>() = covariance.Block(body, tag, 6, 6);
    c.bottomLeftCorner<6, 6>() = c.topRightCorner<6, 6>().transpose();
    c.bottomRightCorner<6, 6>() = covariance.Block(tag, tag, 6, 6);
    return c;
  }

  // Huber's weight at the gate, of a whole sight.
  double Weight(double chi2, bool robust) const {
    return !robust || chi2 <= options_.gate_chi2 ? 1 : std::sqrt(options_.gate_chi2 / chi2);
  }
  double Loss(double chi2, bool robust) const {
    return !robust || chi2 <= options_.gate_chi2 ? chi2 : 2 * std::sqrt(options_.gate_chi2 * chi2) - options_.gate_chi2;
  }

  Eigen::VectorXd TagDeviation() const {
    Eigen::VectorXd d(6 * static_cast<Eigen::Index>(p_.tags.size()));
    for (size_t i = 0; i < p_.tags.size(); ++i)
      d.segment<6>(6 * static_cast<Eigen::Index>(i)) = p_.tags[i].Minus(map_[i]);
    return d;
  }

  double Cost(bool robust) const {
    double cost = std::pow((p_.scale - 1) / p_.scale_sigma, 2);
    for (const ChainSight& s : p_.sights) {
      if (!s.rejected) cost += Loss(Raw(s, nullptr, nullptr).squaredNorm() / std::pow(p_.corner_factor, 2), robust);
    }
    for (const ChainMotion& m : p_.motions) {
      if (body_at_[static_cast<size_t>(m.a)] < 0 || body_at_[static_cast<size_t>(m.b)] < 0) continue;
      cost += Linearize(m, p_).r.squaredNorm();
    }
    const Eigen::VectorXd d = TagDeviation();
    return cost + d.dot(tag_information_ * d);
  }

  // Lower triangle of the normal matrix, and the gradient.
  Eigen::SparseMatrix<double> Normal(bool robust, Eigen::VectorXd* gradient) const {
    std::vector<Triplet> triplets;
    *gradient = Eigen::VectorXd::Zero(size_);
    const auto add = [&](int row, int column, const Eigen::MatrixXd& block) {
      for (int i = 0; i < block.rows(); ++i) {
        for (int j = 0; j < block.cols(); ++j) {
          if (row + i >= column + j) triplets.emplace_back(row + i, column + j, block(i, j));
        }
      }
      if (row < column) {
        for (int i = 0; i < block.rows(); ++i) {
          for (int j = 0; j < block.cols(); ++j) triplets.emplace_back(column + j, row + i, block(i, j));
        }
      }
    };
    for (const ChainSight& s : p_.sights) {
      const int body = body_at_[static_cast<size_t>(s.body)], tag = tags_at_ + 6 * s.tag;
      if (body < 0) continue;
      Eigen::Matrix<double, 8, 12> j;
      const Vector8d r = Residual(s, &j);
      // A rejected one keeps its place among the equations, so that what they say of it can be asked for.
      const double w = s.rejected ? 0 : Weight(r.squaredNorm(), robust);
      const Eigen::Matrix<double, 12, 12> h = w * j.transpose() * j;
      const Eigen::Matrix<double, 12, 1> g = w * j.transpose() * r;
      add(body, body, h.topLeftCorner<6, 6>());
      add(tag, body, h.bottomLeftCorner<6, 6>());
      add(tag, tag, h.bottomRightCorner<6, 6>());
      gradient->segment<6>(body) += g.head<6>();
      gradient->segment<6>(tag) += g.tail<6>();
    }
    for (const ChainMotion& m : p_.motions) {
      const int a = body_at_[static_cast<size_t>(m.a)], b = body_at_[static_cast<size_t>(m.b)];
      if (a < 0 || b < 0) continue;
      const MotionTerms t = Linearize(m, p_);
      add(a, a, t.by_a.transpose() * t.by_a);
      add(b, b, t.by_b.transpose() * t.by_b);
      add(b, a, t.by_b.transpose() * t.by_a);
      add(scale_at_, a, t.by_scale.transpose() * t.by_a);
      add(scale_at_, b, t.by_scale.transpose() * t.by_b);
      triplets.emplace_back(scale_at_, scale_at_, t.by_scale.squaredNorm());
      gradient->segment<6>(a) += t.by_a.transpose() * t.r;
      gradient->segment<6>(b) += t.by_b.transpose() * t.r;
      (*gradient)[scale_at_] += t.by_scale.dot(t.r);
    }
    // Next to nothing, so that a body whose sights were all rejected leaves the equations regular.
    for (const int at : body_at_) {
      for (int k = 0; at >= 0 && k < 6; ++k) triplets.emplace_back(at + k, at + k, 1e-9);
    }
    // The tags' prior, joint: only blocks that are not zero.
    const Eigen::VectorXd d = tag_information_ * TagDeviation();
    gradient->segment(tags_at_, d.size()) += d;
    const int tags = static_cast<int>(p_.tags.size());
    for (int i = 0; i < tags; ++i) {
      for (int j = 0; j <= i; ++j) {
        const Matrix6d block = tag_information_.block<6, 6>(6 * i, 6 * j);
        if (i == j || !block.isZero(0)) add(tags_at_ + 6 * i, tags_at_ + 6 * j, block);
      }
    }
    const double information = 1 / (p_.scale_sigma * p_.scale_sigma);
    triplets.emplace_back(scale_at_, scale_at_, information);
    (*gradient)[scale_at_] += information * (p_.scale - 1);
    Eigen::SparseMatrix<double> normal(size_, size_);
    normal.setFromTriplets(triplets.begin(), triplets.end());
    return normal;
  }

  void Apply(const Eigen::VectorXd& step) {
    for (size_t i = 0; i < p_.bodies.size(); ++i) {
      if (body_at_[i] >= 0) p_.bodies[i] = p_.bodies[i].Plus(step.segment<6>(body_at_[i]));
    }
    for (size_t i = 0; i < p_.tags.size(); ++i) {
      p_.tags[i] = p_.tags[i].Plus(step.segment<6>(tags_at_ + 6 * static_cast<int>(i)));
    }
    p_.scale += step[scale_at_];
  }

  ChainProblem& p_;
  const ChainOptions& options_;
  const CancelToken& cancel_;
  const std::vector<Rigid3d> map_;  // the tags as the map gives them
  std::vector<bool> returned_;      // sights that were rejected and came back
  std::vector<int> body_at_;        // first unknown of each body, -1: held
  int tags_at_ = 0, scale_at_ = 0, size_ = 0;
  Eigen::MatrixXd tag_information_;
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
  // Factors first, so that a run whose motion is noisier than stated does not cost good sights. Rounds that reject
  // come on top.
  constexpr int kMaxRounds = 40;
  for (int round = 0, settled = 0; round < kMaxRounds && settled <= options.variance_rounds; ++round) {
    cancel.ThrowIfCancelled();
    const SelectedInverse covariance = solver.Covariance();
    const bool changed = settled < options.variance_rounds && solver.UpdateFactors(covariance);
    const bool rejected = solver.Snoop(covariance);
    solution.iterations += solver.Iterate(rejected);
    if (!rejected) ++settled, progress.Advance(1);
    if (!changed && !rejected) break;
  }
  solver.Finish(solver.Covariance(), &solution);
  return solution;
}

}  // namespace trigpoint
