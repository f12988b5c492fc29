// COLMAP on the same run, and anybody's models and trajectories of it, held against ours.
#pragma once

#include <string>

#include "datasets/io/views.h"
#include "datasets/project/stage.h"
#include "eval/exchange/colmap_run.h"

namespace trigpoint {

// Of a localized run, below context.out: comparison.csv, differences.csv, steps.csv, panoramas.csv, crosscheck.md,
// figures/. `views`: how the panoramas' views were drawn. A program that is missing or fails is named in the log.
void Crosscheck(const std::string& run, const std::string& variant, const CrosscheckOptions& options,
                const ViewOptions& views, StageContext& context);

}  // namespace trigpoint
