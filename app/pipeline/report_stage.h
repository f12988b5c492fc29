// The last stage: it shows the results of all others.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

StageInfo ReportStage();

}  // namespace trigpoint
