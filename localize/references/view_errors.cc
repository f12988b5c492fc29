#include "localize/references/view_errors.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <map>

#include "calib/estimation/bundle_terms.h"
#include "calib/estimation/sparse_system.h"

namespace trigpoint {
namespace {

// Errors that all observations of some references depend on.
struct SharedErrors {
  bool focal = false;           // one focal length; else the poses of one reference's views
  Eigen::MatrixXd root;         // covariance = root root^T
  std::vector<int> first_view;  // of each reference that has them; -1: it has not
};

SharedErrors MakeErrors(bool focal, const Eigen::MatrixXd& covariance, size_t references) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(covariance);
  const Eigen::VectorXd sigmas = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
  return {focal, axes.eigenvectors() * sigmas.asDiagonal(), std::vector<int>(references, -1)};
}

std::vector<SharedErrors> ErrorsOf(const std::vector<PlacedViews>& references) {
  std::vector<SharedErrors> all;
  std::map<double, size_t> of_focal;
  for (size_t i = 0; i < references.size(); ++i) {
    const auto& [first, focal_px, errors] = references[i];
    if (first < 0) continue;
    if (errors.focal_share > 0) {
      const auto [at, fresh] = of_focal.try_emplace(focal_px, all.size());
      const double variance = errors.focal_share * errors.focal_share;
      if (fresh) all.push_back(MakeErrors(true, Eigen::MatrixXd::Constant(1, 1, variance), references.size()));
      all[at->second].first_view[i] = first;
    }
    if (errors.poses.size() == 0) continue;
    all.push_back(MakeErrors(false, errors.poses, references.size()));
    all.back().first_view[i] = first;
  }
  return all;
}

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

// Gradient of half the cost by all poses, 6 rows each, with the points eliminated: its derivative by each error.
class GradientByErrors {
 public:
  GradientByErrors(const SharedErrors& errors, const BundleProblem& p, const std::vector<int>& image_of)
      : errors_(errors),
        p_(p),
        image_of_(image_of),
        gradient_(Eigen::MatrixXd::Zero(6 * static_cast<Eigen::Index>(p.poses.size()), errors.root.rows())) {
    const size_t n = p.observations.size();
    for (size_t begin = 0, end = 0; begin < n; begin = end) {
      bool concerned = false;
      for (; end < n && p.observations[end].point == p.observations[begin].point; ++end) {
        concerned = concerned || FirstView(end) >= 0;
      }
      if (concerned) AddPoint(begin, end);
    }
  }
  const Eigen::MatrixXd& gradient() const { return gradient_; }

 private:
  int FirstView(size_t k) const {
    if (image_of_[k] >= 0 || !p_.observations[k].active) return -1;
    return errors_.first_view[static_cast<size_t>(-1 - image_of_[k])];
  }

  // Of the observations of one point. Those that depend on the errors move the poses, and the point, which moves the
  // poses of all that see it.
  void AddPoint(size_t begin, size_t end) {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, Eigen::Dynamic> mixed = Eigen::Matrix3Xd::Zero(3, gradient_.cols());
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
      hessian += rho[1] * t.jy.transpose() * t.jy;
      const int first = FirstView(k);
      if (first >= 0 && errors_.focal) {
        Add(o.pose, 0, rho[1] * ByFocal(o), t, &mixed);
      } else if (first >= 0) {
        Add(o.pose, 6 * (o.view - first), rho[1] * ByView(p_, o, t.jp.rightCols<3>()), t, &mixed);
      }
      t.jp *= rho[1];
    }
    const Eigen::Matrix3d inverse = Damped(hessian, 0).inverse();
    if (p_.points_constant || !inverse.allFinite()) return;
    const Eigen::Matrix3Xd point = inverse * mixed;
    for (size_t k = begin; k < end; ++k) {
      const ObservationTerms& t = terms[k - begin];
      Of(p_.observations[k].pose) -= t.jp.transpose() * (t.jy * point);
    }
  }

  Eigen::Block<Eigen::MatrixXd, 6> Of(int pose) { return gradient_.middleRows<6>(6 * static_cast<Eigen::Index>(pose)); }

  template <typename ByErrors>
  void Add(int pose, Eigen::Index column, const ByErrors& by_errors, const ObservationTerms& t,
           Eigen::Matrix3Xd* mixed) {
    Of(pose).middleCols(column, by_errors.cols()) += t.jp.transpose() * by_errors;
    mixed->middleCols(column, by_errors.cols()) += t.jy.transpose() * by_errors;
  }

  const SharedErrors& errors_;
  const BundleProblem& p_;
  const std::vector<int>& image_of_;
  Eigen::MatrixXd gradient_;
};

// The same sum of squares in fewer columns: a rig has many errors, and its pose six unknowns.
Eigen::MatrixXd Compressed(const Eigen::MatrixXd& shifts) {
  constexpr double kLittle = 1e-6;  // of the largest variance: a thousandth of its sigma
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(shifts.transpose() * shifts);
  const Eigen::VectorXd& ascending = axes.eigenvalues();
  const Eigen::Index kept = (ascending.array() > kLittle * ascending.tail<1>().value()).count();
  return shifts * axes.eigenvectors().rightCols(kept);
}

}  // namespace

Eigen::MatrixXd PoseShiftsByViews(const std::vector<PlacedViews>& references, const BundleProblem& p,
                                  const std::vector<int>& image_of, int threads, const CancelToken& cancel) {
  const std::vector<SharedErrors> all = ErrorsOf(references);
  if (all.empty()) return {};
  const BundleCovariance covariance(p, threads, cancel);
  Eigen::MatrixXd out(6 * static_cast<Eigen::Index>(p.poses.size()), 0);
  for (const SharedErrors& errors : all) {
    const Eigen::MatrixXd gradient = GradientByErrors(errors, p, image_of).gradient() * errors.root;
    const Eigen::MatrixXd shifts = Compressed(-covariance.Times(gradient));
    out.conservativeResize(Eigen::NoChange, out.cols() + shifts.cols());
    out.rightCols(shifts.cols()) = shifts;
  }
  return out;
}

}  // namespace trigpoint
