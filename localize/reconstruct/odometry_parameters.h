// What odometry's residuals say of parameters that a reconstruction does not have (where the cameras stand on the body,
// the offset of a clock): to first order, with poses and points moving along.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "calib/base/progress.h"
#include "calib/estimation/bundle.h"

namespace trigpoint {

// Whitened residual of an odometry factor (PoseFactor::Kind::kBetween) for other values of the parameters; all zero: as
// it is.
using ParameterResidual = std::function<Vector6d(const PoseFactor& factor, const Eigen::VectorXd& parameters)>;

struct ParameterEstimate {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

class OdometryParameters {
 public:
  // Of a problem that is solved. `residual` is differentiated numerically, by steps of 1e-5 of each parameter.
  // `sigmas`: 1 sigma of each about zero before anything is measured. Throws NumericError.
  OdometryParameters(const BundleProblem& problem, const ParameterResidual& residual, const Eigen::VectorXd& sigmas,
                     int threads, const CancelToken& cancel);
  // Some of the parameters, in this order, the others zero. Throws NumericError.
  ParameterEstimate Estimate(const std::vector<Eigen::Index>& some) const;

 private:
  Eigen::MatrixXd normal_;
  Eigen::VectorXd right_;
};

}  // namespace trigpoint
