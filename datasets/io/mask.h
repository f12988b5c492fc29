// What of a picture takes part: 8-bit masks of its size, 255 = takes part, 0 = ignored. An empty one ignores nothing.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/base/progress.h"
#include "datasets/io/site.h"

namespace trigpoint {

// The masks of a run's images: pictures, folders of pictures and boxes that run.yaml names, and the transparent parts
// of the images themselves. Thread safe.
class RunMasks {
 public:
  // Reads what is the same for all images of a camera. Throws InputError naming the file for what is not a mask of the
  // camera's size.
  explicit RunMasks(const Run& run);
  // Of the image as LoadGrey gives it. Throws InputError as above.
  cv::Mat Of(const ImageEntry& image) const;
  // The same for features: in the overlap of a 360 picture's views a feature belongs to the view that looks at it most
  // directly, as it was seen once.
  cv::Mat ForFeatures(const ImageEntry& image) const;

 private:
  const Run& run_;
  std::vector<cv::Mat> of_camera_;  // as stored
};

// Looks at the masks of all of a run's images before a stage uses them. Throws InputError naming the first that does
// not fit its picture or cannot be read, and how many more; warns of pictures of which the masks leave nothing, in one
// line.
void CheckMasks(const Run& run, int threads, ProgressSink& progress, const CancelToken& cancel);

// Of a file of a reference, as LoadPanorama and LoadPhoto give it: the mask its table names, a set's masks/, its
// transparent part, and what of the sphere a partial panorama does not show. Throws InputError where a mask has not the
// size of the picture, which is `size` or, of a partial panorama, its own.
cv::Mat ReferenceMask(const Reference& reference, const std::filesystem::path& file, const cv::Size& size);

// The mask of a photo of a hand-held set: masks/ beside the photos, and its transparent part.
cv::Mat SetPhotoMask(const std::filesystem::path& photo, const cv::Size& size);

// Every file that RunMasks reads beside the images.
std::vector<std::filesystem::path> MaskFiles(const Run& run);

// The picture in `folder` that masks an image: <name>.png, or the name with .png in place of its ending, below the
// image's own folders or without them; empty: none. Images may lie in that folder, too: `picture`, the image's own
// file, is not its mask.
std::filesystem::path MaskInFolder(const std::filesystem::path& folder, const std::string& image,
                                   const std::filesystem::path& picture = {});

}  // namespace trigpoint
