// Lengths along a path.
#pragma once

#include <vector>

#include "calib/geometry/rigid3.h"

namespace trigpoint {

// How far a body has travelled up to each of its poses (target_from_body), m.
template <typename Pose = Rigid3d>
std::vector<double> PathLengths(const std::vector<Pose>& poses) {
  std::vector<double> lengths(poses.size(), 0);
  for (size_t k = 1; k < poses.size(); ++k) {
    lengths[k] = lengths[k - 1] + (poses[k].translation - poses[k - 1].translation).norm();
  }
  return lengths;
}

}  // namespace trigpoint
