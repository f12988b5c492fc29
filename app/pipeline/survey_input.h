// What the survey works on, from a project's files and the results of other stages.
#pragma once

#include <string>
#include <vector>

#include "app/pipeline/stages.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// Runs that make the map: their role is survey or both.
std::vector<const Run*> SurveyRuns(const Project& project);

struct SurveyJob {
  SurveyInput input;
  bool has_check = false;  // some surveyed points take no part
  std::string check_note;  // how the check points were chosen, or why there are none
  std::vector<std::string> warnings;
};

// `datum`: what may fix the map (SurveyStageOptions::datum). Throws InputError.
SurveyJob MakeSurveyJob(const Project& project, const StageTarget& target, const std::string& datum);

}  // namespace trigpoint
