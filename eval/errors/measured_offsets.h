// Station offsets as the tags of the survey measured them, in place of what a tape gave.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "datasets/project/project.h"

namespace trigpoint {

// stated (stations.csv of the project), estimated (results/survey/stations.csv alone) or combined (both, weighted).
std::vector<std::string> CheckOffsets(const std::string& how);

// Replaces offset and sigma of the stations that `survey` of this variant measured; the others keep what is stated, as
// do, when combined, those whose two offsets contradict each other. Returns the names of the replaced ones, with one
// sentence in `notes`.
// Throws InputError if the survey has no such table.
std::set<std::string> UseMeasuredOffsets(const Project& project, const std::string& how, const std::string& variant,
                                         std::vector<Station>* stations, std::vector<std::string>* notes);

}  // namespace trigpoint
