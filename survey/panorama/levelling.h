// Which way is up, and where north is: from what cameras wrote, from vertical edges, from how people hold a phone.
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>

#include "survey/panorama/stitch.h"

namespace trigpoint {

// Turns the rig so that -y is up and z looks to the panorama's centre: the middle of what is covered, for a full turn
// where the first photo looks. Fills in level_* and heading_*. `level`: as StitchOptions::level.
//
// lines: the planes through the photos' long straight edges contain the vertical if the edge is vertical. The direction
// most of them contain, within 12 deg of the photos' own top, is taken (robust least squares of normal . up).
void LevelRig(const std::function<cv::Mat(const Photo&)>& load_grey, const std::string& level, int threads,
              const CancelToken& cancel, StitchedRig* rig);

}  // namespace trigpoint
