// Which of the matches that were searched for near their predicted places are true, and which are there by chance
// (docs/method.md section 4, step 3).
#pragma once

#include <vector>

namespace trigpoint {

// A match found within the search circle about its predicted place.
struct FoundMatch {
  double error_px = 0;             // distance from the predicted place
  double descriptor_distance = 0;  // of unit descriptors
  double depth_m = 0;              // of its point
};

// For each match the probability that it is true, by what it looks like and how far its point is, before its own error
// is looked at: a logistic function of descriptor distance and log depth. It is estimated from how many matches of
// their kind lie within half the search radius: true ones all do, and a quarter of those that are there by chance.
std::vector<double> TrueShares(const std::vector<FoundMatch>& matches, double radius_px);

// The same with its error known. `chi2`: the squared error over its covariance, point's part included; `spread`: square
// root of the determinant of that covariance, and `radius` the search radius, both in sigmas of a feature.
double TrueProbability(double share, double chi2, double spread, double radius);

}  // namespace trigpoint
