// The noise of a reference's matches, from a solution that contains them and their points.
#pragma once

#include <vector>

#include "calib/estimation/bundle.h"

namespace trigpoint {

struct WeighedMatch {
  size_t observation = 0;  // of the problem
  double weight = 1;       // probability that it is true, which its weight in the problem contains
};

// Their noise over the one stated by their weights, by the median; 1 with fewer than a hundred residuals. A residual is
// smaller than the noise where its point follows the match: along the rays of the images, which hardly show how far
// away it is. `unknowns`: degrees of freedom that the matches have determined beside their points.
double MatchNoise(const BundleProblem& p, const std::vector<WeighedMatch>& matches, double unknowns);

// Covariance of every point by its active observations, cameras held.
std::vector<Eigen::Matrix3d> PointCovariances(const BundleProblem& p);

}  // namespace trigpoint
