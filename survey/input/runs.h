// The runs that make the map, and their lenses.
#pragma once

#include <string>
#include <vector>

#include "datasets/project/project.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// Runs that make the map: their role is survey or both.
std::vector<const Run*> SurveyRuns(const Project& project);

// Throws InputError where nothing says what the lens of a run is.
void RequireKnownLens(const std::string& run, const std::vector<BodyCamera>& cameras, bool self_calibrate);

void WarnOfGuessedLens(const SurveyRun& run, std::vector<std::string>* warnings);

}  // namespace trigpoint
