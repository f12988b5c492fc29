// Surveyed points and measured distances for the survey.
#pragma once

#include "datasets/project/project.h"
#include "survey/input/job.h"

namespace trigpoint {

// Adds the surveyed points, each at its newest epoch: control where they are `used` as datum, else check points all of
// them. Where no roles are given some are withheld as check points.
void AddControl(const Project& project, bool used, SurveyJob* job);

// Those of distances.csv.
void AddDistances(const Project& project, SurveyJob* job);

}  // namespace trigpoint
