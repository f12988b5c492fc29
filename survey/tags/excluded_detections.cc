#include "survey/tags/excluded_detections.h"

namespace trigpoint {

void LeaveOutExcluded(const Review& review, const std::string& run, std::vector<ImageDetections>& images) {
  for (ImageDetections& image : images) {
    std::erase_if(image.detections, [&](const TagDetection& tag) {
      return review.ExcludesDetection(run, image.image, image.stamp_ns, tag.id);
    });
  }
}

}  // namespace trigpoint
