// Detecting tags in a process of its own: the detector of the library does not check what it allocates.
#pragma once

#include <cstdint>
#include <string>

#include "survey/tags/detection.h"

namespace trigpoint {

struct DetectedApart {
  DetectTagsResult tags;
  int64_t peak_memory_bytes = 0;  // resident, of that process
};

// As DetectTags, which gets as many workers as the free memory allows. `what` names the pictures in errors, `pixels`
// are the largest's. Throws Error where the memory is too small for one worker, or where a signal ended the process.
DetectedApart DetectTagsApart(const std::string& what, double pixels, int64_t count, const PictureSource& picture,
                              const CameraSource& camera, const DetectTagsOptions& options, int threads,
                              ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
