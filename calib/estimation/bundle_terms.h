// Residuals and derivatives of one term of a bundle adjustment; what bundle.cc sums up.
#pragma once

#include "calib/estimation/bearing_terms.h"
#include "calib/estimation/bundle.h"

namespace trigpoint {

// At point `y` and the problem's poses. False behind the view. Without kJacobians only the residual.
template <bool kJacobians>
inline bool Evaluate(const BundleProblem& p, const BearingObservation& o, const Eigen::Vector3d& y,
                     ObservationTerms* out) {
  return EvaluateBearing<kJacobians>(p.poses[static_cast<size_t>(o.pose)], p.views[static_cast<size_t>(o.view)],
                                     o.w.cast<double>(), o.ray.cast<double>(), y, out);
}

// Of a pose factor, whitened: by both poses' left tangents and its scale.
struct FactorTerms {
  Vector6d r = Vector6d::Zero();
  Matrix6d ja = Matrix6d::Zero(), jb = Matrix6d::Zero();
  Vector6d js = Vector6d::Zero();
};
void EvaluateFactor(const BundleProblem& p, const PoseFactor& f, FactorTerms* out);
// Whitened squared residual of a factor, as that of an observation (bundle.h).
inline double SquaredError(const BundleProblem& p, const PoseFactor& f) {
  FactorTerms t;
  EvaluateFactor(p, f, &t);
  return t.r.squaredNorm();
}

// Of a map, whitened: by the left tangents of its rigs' poses, 6 columns each, and last of its frame's, where that is a
// pose.
struct MapTerms {
  Eigen::VectorXd r;
  Eigen::MatrixXd j;
};
MapTerms EvaluateMap(const BundleProblem& p, const MapFactor& map);

}  // namespace trigpoint
