// What a stitched rig says about itself: its centre, its parallax, whether it closes.
#pragma once

#include "survey/panorama/stitch.h"

namespace trigpoint {

// Moves the rig's origin to the mean of the placed photos' centres, with the covariance: what a panorama's centre is
// here. (The point nearest to all optical axes is the other candidate: photos that look up pull it down.)
void CentreRig(StitchedRig* rig);
void DescribeParallax(StitchedRig* rig);
void DescribeClosure(StitchedRig* rig);

// The point nearest to all optical axes (least squares), rig frame.
Eigen::Vector3d CentreOfAxes(const RigState& state);

}  // namespace trigpoint
