// The site from above, drawn with lines and words: runs, panoramas, differences from references, a grid of coordinates.
#pragma once

#include "eval/report/drawing.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {

// Radius of a 95 % ellipse in the plane, in sigmas: root of chi-square's 95 % quantile of two degrees of freedom.
inline constexpr double kSigmas95 = 2.4477;

// 1, 2 or 5 times a power of ten at most `value` > 0: steps of grids and scales.
double RoundDown(double value);

struct Plan {
  Drawing drawing;  // its spots are stations, and panoramas without one
  std::string caption;
};

// Of a scene with a path or a panorama. Lengths in the scene's frame, metres.
Plan PlanOf(const SceneModel& scene);

}  // namespace trigpoint
