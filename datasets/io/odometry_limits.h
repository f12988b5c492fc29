// What a run's odometry and the times of its images leave out.
#pragma once

#include "datasets/io/site.h"

namespace trigpoint {

// Odometry of two dimensions, as from wheels or a laser scanner that is moved in a plane: at all of ten or more poses
// roll and pitch are 0, and the height is the same (to 1e-6 rad, m).
bool IsFlat(const Trajectory& odometry);

// 1 s where the images' times are whole seconds, cut off or rounded, but those of odometry are not: their steps are of
// n and n + 1 seconds. Else 0: a camera that is released every n seconds has even steps, of which few are longer; its
// times are exact, or all off by the same.
double TimeResolution(const Run& run);

}  // namespace trigpoint
