// What lengths are printed in; files stay in metres.
#pragma once

#include <string>

namespace trigpoint {

struct DisplayUnit {
  std::string name = "m";
  double metres = 1;
};

// "m", "ft" (0.3048 m) or "us-ft" (1200/3937 m). Throws OptionError for another name.
DisplayUnit DisplayUnitNamed(const std::string& name);

}  // namespace trigpoint
