// Photos of a hand-held set that were localized one by one: does one of them stand elsewhere than the others?
#pragma once

#include <Eigen/Core>
#include <vector>

namespace trigpoint {

// The index of the photo that contradicts the others most, where it surely does; -1: none, or there are fewer than
// three: of two that differ, either may be wrong. `places`: their centres, m; `covariances`: of these; `held_m`: how
// far each is off the middle of all, 1 sigma of an axis.
int StrayPhoto(const std::vector<Eigen::Vector3d>& places, const std::vector<Eigen::Matrix3d>& covariances,
               double held_m);

}  // namespace trigpoint
