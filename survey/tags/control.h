// Which known points make the map and which only judge it.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "survey/tags/tag_map.h"

namespace trigpoint {

// At least three points whose triangle is no splinter: their second principal extent is at least 0.15 of the first,
// so that tilt about the line through them is not left to chance.
bool AreWellSpread(const std::vector<Eigen::Vector3d>& points);

// Whether three points, in any order, are no splinter: the height above the longest side is at least 0.02 of that side.
bool IsTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);
// Whether some three of the first 25 points are a triangle: then they fix where a map lies and how it is turned.
bool HoldAFrame(const std::vector<Eigen::Vector3d>& points);

// Points that came without a role: of tags and marked points every third becomes a check, with all points of a tag (its
// centre and corners) on one side, but only while at least three well-spread control points remain. Returns how many
// points were withheld; the others are control.
int WithholdChecks(std::vector<SurveyPoint>* points);

}  // namespace trigpoint
