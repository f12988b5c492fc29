// The map of a plan or a check.
#pragma once

#include <string>

#include "eval/plan/findings.h"
#include "eval/report/drawing.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// Of a covariance's first two axes: half axes of the ellipse of one standard deviation, and the first one's angle.
struct HorizontalEllipse {
  double a = 0, b = 0, angle = 0;
};
HorizontalEllipse EllipseOf(const Eigen::Matrix3d& covariance);

// What the legend calls the marks of a map.
struct MapWords {
  std::string seen = "tag", unseen = "tag in no planned picture", path = "planned path";
  std::string suggested = "suggested place; arrow: the way it faces";
  DisplayUnit unit = {};  // of the scale
};
// The site from above with its ellipses, over the aerial image, and a legend of what is there. Numbers:
// suggestions in their order; without any, the ranks of the best gains, three of each kind.
Drawing PlanMap(const PlanFindings& findings, const MapWords& words = {});

}  // namespace trigpoint
