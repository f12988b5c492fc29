// Parts of the stages' commands that other commands use.
#pragma once

#include <string>

#include "app/pipeline/stages.h"

namespace trigpoint {

// A stage's options for the help of its command. `brief`: of a stage without variants, without the ranges.
std::string OptionTable(const StageInfo& stage, bool brief = false);

}  // namespace trigpoint
