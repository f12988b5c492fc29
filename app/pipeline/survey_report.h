// What `survey` tells: report.md for people, summary.json for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "app/pipeline/display_unit.h"
#include "app/pipeline/survey_input.h"

namespace trigpoint {

nlohmann::json SurveySummary(const SurveyJob& job, const SurveyResult& result);
std::string FormatSurvey(const SurveyJob& job, const SurveyResult& result, const DisplayUnit& unit);

}  // namespace trigpoint
