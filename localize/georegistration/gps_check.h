// Does GPS that took no part in the fit to the Earth agree with it?
#pragma once

#include "localize/localize.h"

namespace trigpoint {

// Where the middle of the GPS fixes lies farther from the run, as the geotags place it, than four of its sigmas and
// 10 m (height: five sigmas and 15 m), one of the two is wrong: the difference is added to the fit's covariance, and
// its reason says so. `problem`: the run's poses, body_from_odom.
void HeedGps(const BundleProblem& problem, const std::vector<GpsPlace>& gps, GeoRegistration* geo);

}  // namespace trigpoint
