// What makes lines stand out from any ground.
#pragma once

#include <memory>

#include "eval/scene/scene_view.h"

class vtkRenderer;

namespace trigpoint {

// Broader lines behind the visible paths as the camera sees them from above, white behind dark ones and black behind
// light ones. Taken away with the object; the camera must not move meanwhile.
class Halos {
 public:
  Halos(const SceneModel& model, const SceneView& view, vtkRenderer* renderer, double width_px);
  ~Halos();
  Halos(const Halos&) = delete;
  Halos& operator=(const Halos&) = delete;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace trigpoint
