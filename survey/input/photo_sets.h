// Stitched photo sets as runs of the survey.
#pragma once

#include "datasets/project/stage.h"
#include "survey/input/job.h"
#include "survey/tags/detection.h"

namespace trigpoint {

// Every photo set of the project that is stitched and shows tags. `rigs`: where the stitched rigs lie.
void AddPhotoSets(const Project& project, const RigFolders& rigs, const DetectTagsOptions& options,
                  StageContext& context, SurveyJob* job);

}  // namespace trigpoint
