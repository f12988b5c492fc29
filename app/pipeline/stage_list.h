// Every stage, each defined in app/pipeline/<name>_stage.cc.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

StageInfo FeaturesStage();
StageInfo ReconstructStage();
StageInfo ReferencesStage();
StageInfo LocalizeStage();
StageInfo SiteStage();
StageInfo DetectStage();
StageInfo SurveyStage();
StageInfo ReferenceStage();
StageInfo EvaluateStage();
StageInfo GatesStage();

}  // namespace trigpoint
