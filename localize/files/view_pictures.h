// The pictures of references' views, as their features were found in them.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "localize/reconstruct/frames.h"

namespace trigpoint {

// A panorama, or a photo for each view.
struct ReferenceFiles {
  std::vector<std::filesystem::path> files;
  bool panorama = false;
  ViewRig rig;  // with the cameras that it is matched with
};

// For LocalizeInput::reference_pictures; thread safe.
std::function<std::unique_ptr<const ReferencePictures>(int reference)> PicturesOf(
    std::vector<ReferenceFiles> references);

}  // namespace trigpoint
