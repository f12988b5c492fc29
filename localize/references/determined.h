// Whether what a reference sees fixes its position.
#pragma once

#include <vector>

#include "calib/estimation/bundle.h"

namespace trigpoint {

// 1 sigma of a position along its worst axis, m, by the covariance of rig_from_odom (left tangent).
double LargestPositionSigma(const Rigid3d& rig_from_odom, const Matrix6d& covariance);

// The same by those of these observations of `p` that are active, points held; infinite where they do not fix the pose,
// as where points have gone far away.
double LargestPositionSigma(const Rigid3d& rig_from_odom, const BundleProblem& p,
                            const std::vector<size_t>& observations);

}  // namespace trigpoint
