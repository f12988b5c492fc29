// Whether a solution fits together.
#pragma once

#include "datasets/solution/solution.h"

namespace trigpoint {

// Throws InputError naming the first index that points to nothing, or the first list of a wrong length.
void CheckSolution(const Solution& solution);

}  // namespace trigpoint
