// The pictures of references' views, as their features were found in them.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/camera/rig.h"
#include "datasets/io/views.h"

namespace trigpoint {

// A panorama, or a photo for each view.
struct PicturesOfReference {
  std::vector<std::filesystem::path> files;
  bool panorama = false;
  ViewRig rig;  // with the cameras that it is matched with
};

class ViewPictures {
 public:
  explicit ViewPictures(std::vector<PicturesOfReference> references) : references_(std::move(references)) {}
  // Grey, of all views of a reference; none where a picture cannot be read any more. Thread safe.
  std::vector<cv::Mat> Of(int reference);

 private:
  std::vector<PicturesOfReference> references_;
  RendererOfSize renderers_;
};

}  // namespace trigpoint
