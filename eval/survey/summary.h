// What `survey` tells programs: summary.json.
#pragma once

#include <nlohmann/json.hpp>

#include "eval/survey/findings.h"

namespace trigpoint {

nlohmann::json SurveySummary(const SurveyResult& result, const SurveyFindings& findings);

}  // namespace trigpoint
