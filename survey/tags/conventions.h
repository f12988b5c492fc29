// The convention doctor: does what was brought follow our conventions, before anything is solved?
#pragma once

#include <string>
#include <vector>

#include "survey/tags/map_start.h"

namespace trigpoint {

struct ConventionFinding {
  bool refuse = false;  // the map would be wrong; else a remark
  std::string text;     // what was found, why, what to do
};

// Of the input by itself: order of the corners, order of the quaternions of odometry, tags standing upright.
std::vector<ConventionFinding> CheckInput(const SurveyInput& input);

// Of the tags' pictures along odometry: is the printed size the stated one, are odometry's axes and order of turns
// ours?
std::vector<ConventionFinding> CheckSights(const SurveyInput& input, const MapStart& start);

// Of starting values, before they are moved to the points: axes, unit and height unit of surveyed points.
std::vector<ConventionFinding> CheckPoints(const SurveyInput& input, const MapStart& start,
                                           const std::vector<SurveyPoint>& points);

}  // namespace trigpoint
