#include "survey/tags/hand_eye_sights.h"

#include <optional>
#include <string>

#include "calib/base/error.h"
#include "datasets/io/camchain.h"

namespace trigpoint {
namespace {

constexpr int64_t kMaxGapNs = 2'000'000'000;

}  // namespace

std::vector<HandEyeSight> HandEyeSights(const Run& run, const BodyCamera& camera, const TagSizes& sizes,
                                        const std::vector<ImageDetections>& images, int* without_odometry) {
  std::vector<HandEyeSight> sights;
  for (const ImageDetections& image : images) {
    if (image.camera != camera.name) continue;
    const int64_t stamp = BodyStamp(image.stamp_ns, camera);
    const std::optional<Rigid3d> pose = run.odometry.At(stamp, kMaxGapNs);
    *without_odometry += !pose;
    if (!pose) continue;
    for (const TagDetection& tag : image.detections) {
      const double size = sizes.SizeOf(tag.id);
      if (size <= 0) {
        throw InputError("tags.yaml: the size of tag " + std::to_string(tag.id) +
                         " is missing (size_m); it gives the scale of the camera's position");
      }
      HandEyeSight sight;
      sight.stamp_ns = stamp;
      sight.tag_id = tag.id;
      sight.odom_from_body = *pose;
      for (int k = 0; k < 4; ++k) {
        sight.corners_m[static_cast<size_t>(k)] = TagCorner(size, k);
        sight.pixels[static_cast<size_t>(k)] = tag.corners[static_cast<size_t>(k)];
      }
      sights.push_back(sight);
    }
  }
  return sights;
}

}  // namespace trigpoint
