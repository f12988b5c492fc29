// The unit in which people read lengths; files stay in metres.
#pragma once

#include <string>

#include "eval/text/display_unit.h"

namespace trigpoint {

// "m", "ft" (0.3048 m) or "us-ft" (1200/3937 m). Throws OptionError for another name.
DisplayUnit DisplayUnitNamed(const std::string& name);

}  // namespace trigpoint
