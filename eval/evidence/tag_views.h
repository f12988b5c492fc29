// The images of a run that show tags, with the poses that `localize` found for them.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "datasets/io/site.h"
#include "datasets/solution/solution.h"
#include "eval/errors/results.h"
#include "survey/tags/tag_files.h"
#include "survey/tags/tag_poses.h"

namespace trigpoint {

struct OwnViews {
  std::vector<TagView> views;                           // frame odom; cameras: those of the run
  std::vector<std::pair<int64_t, std::string>> images;  // of each: time and camera
};

// Each camera has the pose of the body at its own time (BodyStamp). `solution`, null for results of older programs,
// knows the body at the images of all cameras, `result` at those of the first one. Images without a pose are left out.
OwnViews TagViews(const Run& run, const LocalizeResult& result, const Solution* solution,
                  const std::vector<ImageDetections>& images);

}  // namespace trigpoint
