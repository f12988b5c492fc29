#include "localize/references/cost_by_errors.h"

#include <Eigen/LU>

#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/sparse_system.h"

namespace trigpoint {
namespace {

// Whitened residual by the focal length that a pinhole's ray was computed with, a share of it: pixels, and so ratios to
// z, get smaller by that share.
Eigen::Vector2d ByFocal(const BearingObservation& o) {
  return o.w.cast<double>() * Eigen::Vector3d(o.ray.x(), o.ray.y(), 0);
}

// By rig_from_view, left tangent: in_view = R^T (in_rig - t). `by_rig`: by in_rig.
Eigen::Matrix<double, 2, 6> ByView(const BundleProblem& p, const BearingObservation& o,
                                   const Eigen::Matrix<double, 2, 3>& by_rig) {
  const Eigen::Vector3d in_rig = p.poses[static_cast<size_t>(o.pose)] * p.points[static_cast<size_t>(o.point)];
  const Eigen::Vector3d centre = p.views[static_cast<size_t>(o.view)].TargetOriginInSource();
  Eigen::Matrix<double, 2, 6> j;
  j << by_rig * Skew(in_rig - centre), -by_rig;
  return j;
}

// Some errors' part of an observation.
struct ByErrors {
  Eigen::Index column = 0;  // of the first
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 6> j;
};

}  // namespace

CostByErrors::CostByErrors(const SharedErrors& errors, const BundleProblem& p)
    : errors_(errors),
      p_(p),
      mixed_(Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), errors.root.rows())),
      hessian_(Eigen::MatrixXd::Zero(errors.root.rows(), errors.root.rows())),
      gradient_(Eigen::VectorXd::Zero(errors.root.rows())) {
  const size_t n = p.observations.size();
  for (size_t begin = 0, end = 0; begin < n; begin = end) {
    bool concerned = false;
    for (; end < n && p.observations[end].point == p.observations[begin].point; ++end) {
      concerned = concerned || FirstView(end) >= 0;
    }
    if (concerned) AddPoint(begin, end);
  }
}

int CostByErrors::FirstView(size_t k) const {
  const BearingObservation& o = p_.observations[k];
  return o.active ? errors_.first_view[static_cast<size_t>(o.pose)] : -1;
}

// Of the observations of one point. Those that depend on the errors move the poses, and the point, which moves the
// poses of all that see it.
void CostByErrors::AddPoint(size_t begin, size_t end) {
  Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
  Eigen::Vector3d left = Eigen::Vector3d::Zero();
  Eigen::Matrix3Xd with_point = Eigen::Matrix3Xd::Zero(3, mixed_.cols());
  std::vector<ObservationTerms> terms(end - begin);
  for (size_t k = begin; k < end; ++k) {
    const BearingObservation& o = p_.observations[k];
    ObservationTerms& t = terms[k - begin];
    if (!o.active || !Evaluate<true>(p_, o, p_.points[static_cast<size_t>(o.point)], &t)) {
      t = {};
      continue;
    }
    double rho[3] = {0, 1, 0};
    if (p_.loss) p_.loss->Evaluate(t.r.squaredNorm(), rho);
    const Eigen::Matrix<double, 3, 2> of_error = rho[1] * t.jy.transpose();
    of_point += of_error * t.jy;
    left += of_error * t.r;
    const int first = FirstView(k);
    if (first >= 0) {
      ByErrors by;
      if (errors_.focal) {
        by.j = ByFocal(o);
      } else {
        by = {6 * (o.view - first), ByView(p_, o, t.jp.rightCols<3>())};
      }
      const Eigen::Index c = by.column, m = by.j.cols();
      Of(o.pose).middleCols(c, m) += rho[1] * t.jp.transpose() * by.j;
      with_point.middleCols(c, m) += of_error * by.j;
      hessian_.block(c, c, m, m) += rho[1] * by.j.transpose() * by.j;
      gradient_.segment(c, m) += rho[1] * by.j.transpose() * t.r;
    }
    t.jp *= rho[1];
  }
  const Eigen::Matrix3d inverse = Damped(of_point, 0).inverse();
  if (p_.points_constant || !inverse.allFinite()) return;
  const Eigen::Matrix3Xd point = inverse * with_point;
  hessian_.noalias() -= with_point.transpose() * point;
  gradient_.noalias() -= point.transpose() * left;
  for (size_t k = begin; k < end; ++k) {
    const ObservationTerms& t = terms[k - begin];
    Of(p_.observations[k].pose) -= t.jp.transpose() * (t.jy * point);
  }
}

}  // namespace trigpoint
