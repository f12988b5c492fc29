// Tags of single pictures, one after the other or from several threads at once.
#pragma once

#include <functional>
#include <memory>

#include "survey/tags/detection.h"

namespace trigpoint {

// Whether a corner of `tag` lies on what `mask` (datasets/io/mask.h) ignores: a tag on the carrier, or on something
// that moves, is none of the site.
bool IsMasked(const TagDetection& tag, const cv::Mat& mask);

class TagFinder {
 public:
  // Throws OptionError.
  explicit TagFinder(const DetectTagsOptions& options);
  ~TagFinder();
  TagFinder(const TagFinder&) = delete;
  TagFinder& operator=(const TagFinder&) = delete;

  // `picture` gives the grey 8-bit picture; an InputError of it makes the picture unusable. `camera`, if given,
  // accounts for lens distortion inside a tag. Adds to `refused` how many were decoded and are below a gate. Thread
  // safe.
  ImageTags Find(const std::function<cv::Mat()>& picture, const Camera* camera, int64_t* refused);

 private:
  struct Pool;
  std::unique_ptr<Pool> pool_;
};

}  // namespace trigpoint
