#pragma once

#include <string>

namespace trigpoint {

// IMG_2 before IMG_10: runs of digits compare as numbers.
bool NaturalLess(const std::string& a, const std::string& b);

}  // namespace trigpoint
