// What a plan could have beside what it has: places for tags, and passes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "eval/plan/layout.h"

namespace trigpoint {

// world_from_tag of places for one more tag: sketched candidates, else places beside the paths, facing them, evenly
// spread, away from the tags that are there.
std::map<std::string, Rigid3d> TagPlaces(const PlanLayout& layout);

// One more pass, as a ranking names it.
struct PassChoice {
  std::string what;
  PlannedPass pass;
};
// Each planned pass again and the other way round; sketched candidate paths, else straight ways across the site between
// the planned paths' points that are farthest from each other. `copy`: 1 where a pass is added for the first
// time, 2 for the second; it is part of the name, so that each copy has draws of its own.
std::vector<PassChoice> PassChoices(const PlanLayout& layout, int copy);

}  // namespace trigpoint
