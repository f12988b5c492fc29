// What a project's results amount to, as lines of an ending.
#pragma once

#include "app/cli/ending.h"
#include "datasets/project/project.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

struct ProjectFactsOptions {
  bool errors = true;        // against references, and gates; false: those that are there belong to earlier results
  bool check_points = true;  // the tag map at surveyed points
  std::string variant;       // the set of results; empty: the default ones
};

// Facts: answers, errors against references, per run, stated sigmas, check points. Problems: gates that are not passed,
// runs without georeference, outlying geotags. Made of the same numbers as the report's first screen.
void AddProjectFacts(const Project& project, const DisplayUnit& unit, const ProjectFactsOptions& options,
                     Ending* ending);

// The tag map at surveyed points that took no part in it, if there are any.
void AddCheckPoints(const Project& project, const DisplayUnit& unit, Ending* ending);

}  // namespace trigpoint
