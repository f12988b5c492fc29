#include "eval/text/display_unit.h"

#include "calib/base/error.h"

namespace trigpoint {

DisplayUnit DisplayUnitNamed(const std::string& name) {
  if (name == "m") return {name, 1};
  if (name == "ft") return {name, 0.3048};
  if (name == "us-ft") return {name, 1200.0 / 3937.0};
  throw OptionError("unknown unit '" + name + "'; expected m, ft or us-ft");
}

}  // namespace trigpoint
