// The site from above, drawn with lines and words: runs, panoramas, differences from references, a grid of coordinates.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "eval/report/drawing.h"
#include "eval/scene/scene_model.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// Radius of a 95 % ellipse in the plane, in sigmas: root of chi-square's 95 % quantile of two degrees of freedom.
inline constexpr double kSigmas95 = 2.4477;

// 1, 2 or 5 times a power of ten at most `value` > 0: steps of grids and scales.
double RoundDown(double value);

// What is drawn larger than life at a place of a plan: an arrow with an ellipse. Metres in the plane.
struct EnlargedMark {
  Eigen::Vector2d place_m, low_m, high_m;  // low_m, high_m: corners of the box around both, from the place
  double arrow_m = 0, half_axis_m = 0;     // length of the arrow, larger half axis of the ellipse
};

// The enlargement with which a mark stays in the frame from `low_m` to `high_m`, and its ellipse's half axis within
// half of `apart_m`, so that neighbours at most touch; infinite for a mark without extent, 0 for one outside the frame.
double MostEnlarged(const EnlargedMark& mark, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m,
                    double apart_m = std::numeric_limits<double>::infinity());

// The median distance of a mark from the nearest one at another place; the frame's smaller side if there is none. Marks
// closer than 2 % of the larger side count as one place.
double ApartOf(const std::vector<EnlargedMark>& marks, const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m);

// 1, 2 or 5 times a power of ten, at least 1: the median arrow is at most `arrow_m` long on the plan, and all marks
// stay within MostEnlarged. Those that allow less than a fifth of what the median one does are beyond it, if they are
// fewer than one in eight.
double EnlargementOf(const std::vector<EnlargedMark>& marks, const Eigen::Vector2d& low_m,
                     const Eigen::Vector2d& high_m, double arrow_m);

// "at true scale", "5 times enlarged".
std::string EnlargedText(double factor);

struct Plan {
  Drawing drawing;  // its spots are stations, and panoramas without one
  std::string caption;
};

// Of a scene with a path or a panorama. Coordinates are those of the scene's frame, in `unit`.
Plan PlanOf(const SceneModel& scene, const DisplayUnit& unit);

}  // namespace trigpoint
