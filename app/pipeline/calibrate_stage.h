// The stage behind `trigpoint calibrate`. It is not among Stages(): its results have names of their own and are made
// when somebody asks for them, not for every run.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

// `make` takes the calibration's name as the target's run.
StageInfo CalibrateStage();

}  // namespace trigpoint
