// Whether surveyed points and satellites mean the same place and frame.
#pragma once

#include <optional>

#include "calib/geo/geodetic.h"
#include "datasets/project/project.h"
#include "survey/input/job.h"

namespace trigpoint {

// The frame that the control's coordinates are in. It is the site's, with two exceptions: the site has no origin, or
// all control is given as x_m, y_m, z_m and lies elsewhere than geotags and GPS (without them: far from the site's
// origin).
std::optional<LocalFrame> FrameOfControl(const Project& project, const SurveyInput& input);

// Requires that surveyed points and satellite positions agree on the site: same zone, hemisphere and unit of height.
// Throws InputError.
void RequireOneSite(const Project& project, SurveyJob* job);

}  // namespace trigpoint
