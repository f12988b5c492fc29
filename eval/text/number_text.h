// Numbers as people read them.
#pragma once

#include <optional>
#include <string>

namespace trigpoint {

// In `unit` with so many decimals; `missing` where the value is not known.
std::string NumberText(const std::optional<double>& value, int decimals, const char* missing = "", double unit = 1);

}  // namespace trigpoint
