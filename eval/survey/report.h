// What `survey` tells people: report_<unit>.md.
#pragma once

#include <string>

#include "eval/survey/findings.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

std::string FormatSurvey(const SurveyResult& result, const SurveyFindings& findings, const DisplayUnit& unit);

}  // namespace trigpoint
