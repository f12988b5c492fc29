// Is a run's odometry in metres?
#pragma once

#include <optional>
#include <string>

#include "datasets/io/site.h"

namespace trigpoint {

// A message where the extents of the run by odometry and by GPS differ by more than five sigmas and a factor of two:
// another unit than metres. Nothing where they agree, or where GPS shows too little.
std::optional<std::string> FindOtherUnit(const Run& run);

}  // namespace trigpoint
