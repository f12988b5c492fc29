// The stage that runs only by its own command: COLMAP takes its time.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

StageInfo CrosscheckStage();

}  // namespace trigpoint
