// Which unit of length is a factor to metres?
#pragma once

#include <string>

namespace trigpoint {

// In words, for messages: the unit of length nearest to `factor` metres, such as "feet (0.3048 m)"; empty where none is
// within `tolerance` (of the logarithm).
std::string UnitOfLength(double factor, double tolerance);

}  // namespace trigpoint
