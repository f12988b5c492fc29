// The tables beside the tag map: results/survey/control.csv, check.csv, residuals.csv, distances.csv, sessions.csv,
// budget.csv, changes.csv and tags_crs.csv.
#pragma once

#include <filesystem>

#include "calib/base/progress.h"
#include "datasets/project/project.h"
#include "eval/survey/findings.h"

namespace trigpoint {

// Into an existing folder. Throws IoError. A coordinate system that cannot be used is named in a warning.
void WriteSurveyTables(const Project& project, const SurveyJob& job, const SurveyResult& result,
                       const SurveyFindings& findings, const std::filesystem::path& out, ProgressSink& progress);

}  // namespace trigpoint
