// The stage that runs only by its own command: COLMAP takes its time.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

StageInfo CrosscheckStage();

// Is it left out of `run` and `status`?
inline bool OnlyOnRequest(const StageInfo& stage) { return stage.name == "crosscheck"; }

}  // namespace trigpoint
