// Scene points that tie a run's pictures together, from its reconstruction.
#pragma once

#include "datasets/solution/solution.h"
#include "survey/tags/tag_map.h"

namespace trigpoint {

// Fills start, tie_points, ties and tie_loss_chi2 of `survey`. The longest tracks are kept, until every picture has
// `ties_per_image` of them.
void AddTies(const Solution& solution, int ties_per_image, SurveyRun* survey);

}  // namespace trigpoint
