// A path in a table or YAML file that leaves the project: never skipped like a bad row, always the user's to mend.
#pragma once

#include "calib/base/error.h"

namespace trigpoint {

class PathError : public InputError {
 public:
  using InputError::InputError;
};

}  // namespace trigpoint
