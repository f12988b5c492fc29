// What `check` (eval/intake) takes from the other stages of a project.
#pragma once

#include "eval/intake/check.h"

namespace trigpoint {

CheckSources SourcesOfProject();

}  // namespace trigpoint
