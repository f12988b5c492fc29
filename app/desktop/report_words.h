#pragma once

#include <vector>

namespace trigpoint {

// Texts of the report's code and reasons of the stages that windows show, with places (%1 to %9) for names, numbers and
// other texts of this list.
std::vector<const char*> ReportWords();

}  // namespace trigpoint
