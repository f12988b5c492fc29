// Localized runs against a folder of true poses.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "datasets/project/stage.h"
#include "eval/errors/evaluate.h"

namespace trigpoint {

// Writes truth.json below context.out, and a paragraph for people for each run. `given`: a folder, below the project or
// absolute. A run without true poses is named in the log; throws InputError if no run can be scored.
void ScoreTruth(const std::filesystem::path& given, const std::vector<EvaluatedRun>& runs, StageContext& context,
                std::vector<std::string>* notes);

}  // namespace trigpoint
