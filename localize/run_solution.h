// What `reconstruct` and `localize` find, as solutions (datasets/solution).
#pragma once

#include <string>

#include "datasets/solution/solution.h"
#include "localize/localize.h"
#include "localize/reconstruct/reconstruct_run.h"

namespace trigpoint {

// Of a run by itself. The reconstruction is given up: a long run has no room for it twice. Without covariances.
Solution SolutionOf(const LocalizeInput& input, const std::string& run, const std::string& mode,
                    RunReconstruction reconstruction);
// Whether the observations of its points are aligned with each other (reconstruct/patch_alignment.h).
bool HasAlignedPoints(const SolutionCounts& counts);
// The reconstruction of a solution that was made of this input. Throws InputError where the images are others.
Reconstruction ReconstructionOf(const LocalizeInput& input, Solution solution);

// Of a run with its references, and where it lies; `counts`: how its reconstruction came about. The result's
// reconstruction and covariances are given up. A reference's row of panoramas.csv is its own name.
Solution SolutionOf(const LocalizeInput& input, const std::string& run, const std::string& mode,
                    const SolutionCounts& counts, Localization* result);

}  // namespace trigpoint
