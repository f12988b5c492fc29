// A rig of views: the one idea of a reference. A panorama is eight views with one centre, a hand-held set is
// N views with refined centres, a single photo is one view; a robot's cameras are a rig too.
#pragma once

#include <string>
#include <vector>

#include "calib/camera/camera.h"
#include "calib/geometry/rigid3.h"

namespace trigpoint {

struct View {
  std::string name;
  Camera camera;
  Rigid3d rig_from_view;                   // metres; identity translation for a central panorama
  Matrix6d covariance = Matrix6d::Zero();  // of rig_from_view; zero where it is exact by construction
};

struct ViewRig {
  std::string name;
  std::vector<View> views;
};

}  // namespace trigpoint
