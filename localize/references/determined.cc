#include "localize/references/determined.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "calib/estimation/bundle_terms.h"

namespace trigpoint {

double LargestPositionSigma(const Rigid3d& rig_from_odom, const Matrix6d& covariance) {
  const Matrix6d of_place = InverseCovariance(rig_from_odom, covariance);
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(of_place.bottomRightCorner<3, 3>()).eigenvalues()(2));
}

double LargestPositionSigma(const Rigid3d& rig_from_odom, const BundleProblem& p,
                            const std::vector<size_t>& observations) {
  Matrix6d information = Matrix6d::Zero();
  for (const size_t k : observations) {
    const BearingObservation& o = p.observations[k];
    ObservationTerms t;
    if (!o.active || !Evaluate<true>(p, o, p.points[static_cast<size_t>(o.point)], &t)) continue;
    information += t.jp.transpose() * t.jp;
  }
  const Eigen::LLT<Matrix6d> llt(information);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  const double sigma = LargestPositionSigma(rig_from_odom, llt.solve(Matrix6d::Identity()));
  return std::isfinite(sigma) ? sigma : std::numeric_limits<double>::infinity();
}

}  // namespace trigpoint
