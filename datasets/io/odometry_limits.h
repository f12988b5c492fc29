// What a run's odometry and the times of its images leave out.
#pragma once

#include "datasets/io/site.h"

namespace trigpoint {

// Odometry of two dimensions, as from wheels or a laser scanner that is moved in a plane: its heights, roll and pitch
// are the same (to 1e-6 m, rad) at all of ten or more poses.
bool IsFlat(const Trajectory& odometry);

// 1 s where the images' times are whole seconds, cut off or rounded, but those of odometry are not; else 0. A camera
// that is released every n seconds has even steps, of which few are longer: its times are exact, or all off by the
// same.
double TimeResolution(const Run& run);

}  // namespace trigpoint
