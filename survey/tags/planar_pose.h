// The pose of a tag from one picture: a plane has two that fit.
#pragma once

#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"
#include "survey/tags/tag_residual.h"

namespace trigpoint {

struct PlanarPose {
  Rigid3d cam_from_tag;
  double rms_px = 0;  // of the corners, per axis
  double chi2 = 0;    // sum of squared whitened residuals, 2 degrees of freedom
};

// Both solutions (Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014, as in OpenCV), each
// refined on the corners' bearings; best first. One if the other is behind the camera or they coincide; none if the
// corners are degenerate. Any central camera: the equations are solved on a plane tangent to the view's direction.
std::vector<PlanarPose> EstimatePlanarPoses(const TagSight& sight, double size_m);

}  // namespace trigpoint
