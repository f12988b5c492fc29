// plan: the accuracy that a survey would state, before the trip.
#pragma once

#include "app/pipeline/stages.h"

namespace trigpoint {

// results/plan. Not part of `run`: it is asked for.
StageInfo PlanStage();

}  // namespace trigpoint
