#include "app/pipeline/reference_tags.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "app/pipeline/detect_apart.h"
#include "app/pipeline/set_localization.h"
#include "datasets/io/image.h"
#include "datasets/io/views.h"
#include "survey/panorama/rig_files.h"

namespace trigpoint {
namespace {

constexpr int kLargestView = 2048;  // px

// Fills in the rig; the pictures of its views.
std::vector<cv::Mat> LoadPictures(const Project& project, const Reference& reference, ReferenceTags* out) {
  std::vector<cv::Mat> pictures;
  if (reference.kind == ReferenceKind::kPanorama) {
    const cv::Mat panorama = LoadPanorama(reference.files.front(), true);
    ViewOptions options;  // its own resolution: far tags are small
    options.size_px = std::min(kLargestView, static_cast<int>(std::lround(panorama.cols / std::numbers::pi)));
    out->rig = PanoramaViews(reference.name, panorama.cols, options);
    for (const View& view : out->rig.views) pictures.push_back(RenderView(panorama, view));
  } else if (reference.kind == ReferenceKind::kPhotoSet) {
    const auto rigs = StitchedRigs(project);
    const auto rig = rigs.find(reference.name);
    if (rig == rigs.end() || !std::filesystem::exists(rig->second / "rig.csv")) return pictures;
    const RigFile file = ReadRigFiles(rig->second);
    out->rig = file.rig;
    out->rig_scale_sigma = file.radius_log_sigma;
    for (const View& view : out->rig.views) {
      const auto photo = std::find_if(reference.files.begin(), reference.files.end(),
                                      [&](const auto& path) { return path.filename() == view.name; });
      if (photo == reference.files.end()) throw InputError(reference.name + ": its rig has no photo " + view.name);
      pictures.push_back(LoadPhoto(*photo, view.camera, true));
    }
  } else if (reference.camera) {
    out->rig.views.push_back({"0", *reference.camera, Rigid3d()});
    pictures.push_back(LoadPhoto(reference.files.front(), *reference.camera, true));
  }
  return pictures;
}

}  // namespace

ReferenceTags FindReferenceTags(const Project& project, const Reference& reference, const DetectTagsOptions& options,
                                const StageContext& context) {
  ReferenceTags out;
  const std::vector<cv::Mat> pictures = LoadPictures(project, reference, &out);
  if (pictures.empty()) return out;
  double pixels = 0;
  for (const cv::Mat& picture : pictures) pixels = std::max(pixels, static_cast<double>(picture.total()));
  ProgressSink silent;
  out.tags = DetectTagsApart(
                 reference.name, pixels, static_cast<int64_t>(pictures.size()),
                 [&](int64_t i) { return pictures[static_cast<size_t>(i)]; },
                 [&](int64_t i) { return &out.rig.views[static_cast<size_t>(i)].camera; }, options, context.threads,
                 silent, context.cancel)
                 .tags.images;
  return out;
}

}  // namespace trigpoint
