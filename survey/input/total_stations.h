// Readings of total stations for the survey.
#pragma once

#include <optional>
#include <string>

#include "calib/base/progress.h"
#include "calib/geo/geodetic.h"
#include "datasets/project/project.h"
#include "survey/input/job.h"

namespace trigpoint {

// Readings of a total station, with the network that they make of the control points; where that has tags, the map
// begins. `enu`: world's frame; unset: world is a frame of the surveyor's own.
void AddStations(const Project& project, const std::optional<LocalFrame>& enu, const CancelToken& cancel,
                 SurveyJob* job);

// Whether a control point is one that a total station reads or stands on.
bool IsInNetwork(const SurveyJob& job, const std::string& point);

}  // namespace trigpoint
