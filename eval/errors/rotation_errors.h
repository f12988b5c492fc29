// How far the panoramas' rotations are from those that the tags they show give them.
#pragma once

#include "datasets/project/project.h"
#include "eval/errors/evaluate.h"

namespace trigpoint {

// Fills error_rot_deg and sigma_rot_deg of the rows against a map that has measured the panorama's rotation by the tags
// it shows (stations.csv beside the map's tags.csv). Other rows stay as they are: a single tag's place says nothing of
// it.
void FillRotationErrors(const Project& project, const std::vector<EvaluatedRun>& runs, Evaluation* evaluation);

}  // namespace trigpoint
