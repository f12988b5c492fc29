#include "localize/references/match_noise.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/base/median.h"
#include "calib/estimation/bundle_terms.h"

namespace trigpoint {

double MatchNoise(const BundleProblem& p, const std::vector<WeighedMatch>& matches, double unknowns) {
  constexpr double kLeastShare = 0.25;  // of the noise's variance, in a residual that is used
  constexpr size_t kLeastErrors = 100;
  const std::vector<Eigen::Matrix3d> covariances = PointCovariances(p);
  std::vector<double> errors;
  double freedom = 0;
  for (const WeighedMatch& match : matches) {
    const BearingObservation& o = p.observations[match.observation];
    const auto point = static_cast<size_t>(o.point);
    ObservationTerms t;
    if (!o.active || !Evaluate<true>(p, o, p.points[point], &t)) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> left(Eigen::Matrix2d::Identity() -
                                                              t.jy * covariances[point] * t.jy.transpose());
    for (Eigen::Index c = 0; c < 2; ++c) {
      const double share = left.eigenvalues()(c);
      freedom += std::max(0.0, share);
      if (share < kLeastShare) continue;
      // A match of half the weight has half the variance in these units; its point's part of it is as large as ever.
      const double expected = share * (match.weight * share + 1 - share);
      errors.push_back(std::pow(left.eigenvectors().col(c).dot(t.r), 2) / expected);
    }
  }
  if (errors.size() < kLeastErrors) return 1;
  return SigmaRatio(std::move(errors), 1) / std::sqrt(std::max(0.1, 1 - unknowns / freedom));
}

std::vector<Eigen::Matrix3d> PointCovariances(const BundleProblem& p) {
  constexpr double kWeakest = 1e-6;  // information that every point has, 1/m^2
  std::vector<Eigen::Matrix3d> information(p.points.size(), Eigen::Matrix3d::Identity() * kWeakest);
  for (const BearingObservation& o : p.observations) {
    ObservationTerms t;
    if (!o.active || !Evaluate<true>(p, o, p.points[static_cast<size_t>(o.point)], &t)) continue;
    information[static_cast<size_t>(o.point)] += t.jy.transpose() * t.jy;
  }
  for (Eigen::Matrix3d& m : information) m = m.inverse().eval();
  return information;
}

}  // namespace trigpoint
