#include "localize/files/view_pictures.h"

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {

std::vector<cv::Mat> ViewPictures::Of(int reference) {
  const PicturesOfReference& r = references_[static_cast<size_t>(reference)];
  std::vector<cv::Mat> pictures;
  try {
    if (!r.panorama) {
      for (size_t v = 0; v < r.files.size(); ++v)
        pictures.push_back(AsMatched(LoadPicture(r.files[v], true), r.rig.views[v].camera));
      return pictures;
    }
    const cv::Mat panorama = LoadPanorama(r.files.front(), true);
    const auto renderer = renderers_.Get(r.rig, panorama.size());
    const cv::Mat prepared = renderer->Prepare(panorama);
    for (size_t v = 0; v < r.rig.views.size(); ++v) pictures.push_back(renderer->Render(prepared, v));
    return pictures;
  } catch (const InputError&) {
    return {};
  }
}

}  // namespace trigpoint
