// Does GPS agree with the run's place on the Earth, and with its shape?
#pragma once

#include "localize/localize.h"

namespace trigpoint {

inline constexpr size_t kLeastGpsFixes = 5;  // with fewer nothing is said

// Of GPS that took no part in the fit. Where fixes lie, in the median, farther from the run, as the geotags place it,
// than four of their sigmas and 10 m (height: five sigmas and 15 m), one of the two is wrong: the turn and shift
// between them (of heights alone where only these differ) is added to the fit's covariance, and its reason says so;
// beyond 0.3 rad it is withheld. `problem`: the run's poses, body_from_odom.
void HeedGps(const BundleProblem& problem, const std::vector<GpsPlace>& gps, GeoRegistration* geo);

// Of GPS that the fit is from, of which correlated fixes take no part: the run's plan is laid over all of them. Where
// they are farther off than twice their sigmas in the median, the fit's covariance grows by the square of that ratio;
// beyond five times it is withheld. So it is where another reading of GPS, mirrored or at another time, is a thousand
// times as likely, given errors that wander in gps_correlation_s (a Gauss-Markov process). The reason says so. Where
// GPS is `alone`, what its clock leaves open of the place is added to the covariance: on a straight line or an arc, an
// offset moves the run along its path and is seen by nothing.
void CheckGpsShape(const BundleProblem& problem, const std::vector<GpsPlace>& gps,
                   const GeoRegistrationOptions& options, bool alone, GeoRegistration* geo);

}  // namespace trigpoint
