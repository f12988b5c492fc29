#include "localize/files/view_pictures.h"

#include <utility>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/views.h"
#include "localize/reconstruct/feature_store.h"

namespace trigpoint {
namespace {

// Nothing where the picture has gone or changed since features were found in it.
template <typename F>
cv::Mat IfReadable(F&& read) {
  try {
    return read();
  } catch (const InputError&) {
    return {};
  } catch (const IoError&) {
    return {};
  }
}

class PanoramaPictures final : public ReferencePictures {
 public:
  PanoramaPictures(const ReferenceFiles& files, RendererOfSize* renderers) {
    const cv::Mat panorama = IfReadable([&] { return LoadPanorama(files.files.front(), true); });
    if (panorama.empty()) return;
    renderer_ = renderers->Get(files.rig, panorama.size());
    prepared_ = renderer_->Prepare(panorama);
  }
  cv::Mat View(int view) const override {
    return renderer_ ? renderer_->Render(prepared_, static_cast<size_t>(view)) : cv::Mat();
  }

 private:
  std::shared_ptr<const ViewRenderer> renderer_;
  cv::Mat prepared_;
};

class PhotoPictures final : public ReferencePictures {
 public:
  explicit PhotoPictures(const ReferenceFiles& files) : files_(files) {}
  cv::Mat View(int view) const override {
    const auto v = static_cast<size_t>(view);
    return IfReadable([&] { return AsMatched(LoadPicture(files_.files[v], true), files_.rig.views[v].camera); });
  }

 private:
  const ReferenceFiles& files_;
};

}  // namespace

std::function<std::unique_ptr<const ReferencePictures>(int reference)> PicturesOf(
    std::vector<ReferenceFiles> references) {
  struct Shared {
    std::vector<ReferenceFiles> references;
    RendererOfSize renderers;
  };
  const auto shared = std::make_shared<Shared>();
  shared->references = std::move(references);
  return [shared](int reference) -> std::unique_ptr<const ReferencePictures> {
    const ReferenceFiles& files = shared->references[static_cast<size_t>(reference)];
    if (files.panorama) return std::make_unique<PanoramaPictures>(files, &shared->renderers);
    return std::make_unique<PhotoPictures>(files);
  };
}

}  // namespace trigpoint
