// The site from above, drawn with lines and words: runs, panoramas, differences from references, a grid of coordinates.
#pragma once

#include "eval/report/drawing.h"
#include "eval/scene/scene_model.h"

namespace trigpoint {

struct Plan {
  Drawing drawing;
  std::string caption;
};

// Of a scene with a path or a panorama. Lengths in the scene's frame, metres.
Plan PlanOf(const SceneModel& scene);

}  // namespace trigpoint
