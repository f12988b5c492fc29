#include "survey/input/reference_tags.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "calib/base/error.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"
#include "datasets/io/rig_file.h"
#include "datasets/io/views.h"
#include "datasets/project/reference_parts.h"
#include "survey/panorama/rig_files.h"
#include "survey/tags/detect_apart.h"
#include "survey/tags/tag_finder.h"

namespace trigpoint {
namespace {

constexpr int kLargestView = 2048;  // px

// Of a view: grey, and what of it takes part (empty: all of it).
struct ViewPicture {
  cv::Mat grey, mask;
};

ViewPicture LoadView(const Reference& reference, const std::filesystem::path& photo, const Camera& camera) {
  const cv::Mat grey = LoadPhoto(photo, camera, true);
  return {grey, ReferenceMask(reference, photo, grey.size())};
}

// Fills in the rig; the pictures of its views.
std::vector<ViewPicture> LoadPictures(const Reference& reference, const RigFolders& rigs, ReferenceTags* out) {
  std::vector<ViewPicture> pictures;
  if (reference.kind == ReferenceKind::kPanorama) {
    const cv::Mat panorama = LoadPanorama(reference.files.front(), true);
    const cv::Mat mask = ReferenceMask(reference, reference.files.front(), panorama.size());
    ViewOptions options;  // its own resolution: far tags are small
    options.size_px = std::min(kLargestView, static_cast<int>(std::lround(panorama.cols / std::numbers::pi)));
    out->rig = PanoramaViews(reference.name, panorama.cols, options);
    for (const View& view : out->rig.views) {
      const cv::Mat of_view = mask.empty() ? cv::Mat() : cv::Mat(RenderView(mask, view) == 255);
      pictures.push_back({RenderView(panorama, view), of_view});
    }
  } else if (reference.kind == ReferenceKind::kPhotoSet) {
    const auto rig = rigs.find(reference.name);
    if (rig == rigs.end() || !std::filesystem::exists(rig->second / "rig.csv")) return pictures;
    const RigFile file = ReadRigFiles(rig->second);
    out->rig = file.rig;
    out->rig_scale_sigma = file.radius_log_sigma;
    for (const View& view : out->rig.views) {
      const auto photo = std::find_if(reference.files.begin(), reference.files.end(),
                                      [&](const auto& path) { return path.filename() == view.name; });
      if (photo == reference.files.end()) throw InputError(reference.name + ": its rig has no photo " + view.name);
      pictures.push_back(LoadView(reference, *photo, view.camera));
    }
  } else if (reference.camera) {
    out->rig.views.push_back({"0", *reference.camera, Rigid3d()});
    pictures.push_back(LoadView(reference, reference.files.front(), *reference.camera));
  }
  return pictures;
}

}  // namespace

ReferenceTags FindReferenceTags(const Reference& reference, const RigFolders& rigs, const DetectTagsOptions& options,
                                const StageContext& context) {
  ReferenceTags out;
  const std::vector<ViewPicture> pictures = LoadPictures(reference, rigs, &out);
  if (pictures.empty()) return out;
  double pixels = 0;
  for (const ViewPicture& picture : pictures) pixels = std::max(pixels, static_cast<double>(picture.grey.total()));
  ProgressSink silent;
  out.tags = DetectTagsApart(
                 reference.name, pixels, static_cast<int64_t>(pictures.size()),
                 [&](int64_t i) { return pictures[static_cast<size_t>(i)].grey; },
                 [&](int64_t i) { return &out.rig.views[static_cast<size_t>(i)].camera; }, options, context.threads,
                 silent, context.cancel)
                 .tags.images;
  for (size_t i = 0; i < pictures.size(); ++i) {
    std::erase_if(out.tags[i].detections, [&](const TagDetection& tag) { return IsMasked(tag, pictures[i].mask); });
  }
  return out;
}

}  // namespace trigpoint
