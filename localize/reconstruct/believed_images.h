// A reconstruction whose images are believed as far as the noise of their features allows. Where they contradict
// odometry, `Reconstruct` widens their noise until both fit, and little remains to be seen of the contradiction.
#pragma once

#include <optional>

#include "localize/reconstruct/reconstruct.h"

namespace trigpoint {

struct BelievedImages {
  BundleProblem problem;  // solved
  double cost = 0;        // 1/2 sum rho
};

// With no more noise than correlation along tracks explains; nothing where it has not been widened beyond that. Throws
// NumericError.
std::optional<BelievedImages> BelieveImages(const Reconstruction& reconstruction, int threads,
                                            const CancelToken& cancel);

}  // namespace trigpoint
