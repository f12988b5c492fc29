// The rows of panoramas.csv: panoramas, photos, and hand-held sets whose photos were answered one by one.
#pragma once

#include <string>
#include <vector>

#include "datasets/solution/solution.h"

namespace trigpoint {

// Whoever holds a camera turns it about himself: its centre is off the middle of a set by so much, 1 sigma of an axis.
inline constexpr double kHeld_m = 0.15;

struct ReferenceRow {
  std::string name;
  std::vector<size_t> references;  // of the solution, all that belong to it
  std::vector<size_t> localized;
  size_t shown = 0;  // the first that is localized, else the first
  // Where any is localized: the mean of their centres, with the attitude of the one shown.
  Rigid3d odom_from_pano;
  // How far that mean may be from a set's centre, which is the mean of all its photos: 1 sigma of an axis, metres of
  // the run's frame. 0 of what is no set.
  double centre_sigma_m = 0;
};

// In the order of the references.
std::vector<ReferenceRow> ReferenceRows(const Solution& solution);

// Of odom_from_pano and world_from_pano (left tangent), from what the solution holds. The photos of a set share the
// run's error, so that their mean has the mean of their covariances, and centre_sigma_m beside it. Need a localized
// reference, covariances, and a georeference for world.
Matrix6d OdomCovariance(const Solution& solution, const ReferenceRow& row);
Matrix6d WorldCovariance(const Solution& solution, const ReferenceRow& row);

}  // namespace trigpoint
