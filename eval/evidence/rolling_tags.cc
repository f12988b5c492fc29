#include "eval/evidence/rolling_tags.h"

#include <algorithm>
#include <cmath>

#include "datasets/io/camchain.h"
#include "datasets/io/motion_rates.h"
#include "localize/reconstruct/rolling_shutter.h"

namespace trigpoint {
namespace {

const BodyCamera* RollingCamera(const Run& run, const std::string& name) {
  for (const BodyCamera& camera : run.cameras) {
    if (camera.name == name && camera.readout_s != 0) return &camera;
  }
  return nullptr;
}

// 1/m; 0 of a tag whose size is not known. The longest side is the one that is foreshortened least.
double InverseDistance(const Camera& camera, const TagDetection& tag, double size_m) {
  double longest = 0;  // angle, rad
  for (size_t k = 0; k < 4; ++k) {
    const auto a = camera.Unproject(tag.corners[k]), b = camera.Unproject(tag.corners[(k + 1) % 4]);
    if (a && b) longest = std::max(longest, std::atan2(a->cross(*b).norm(), a->dot(*b)));
  }
  return size_m > 0 ? longest / size_m : 0;
}

}  // namespace

void MoveToImageTimes(const Run& run, const TagSizes& sizes, std::vector<ImageDetections>* images) {
  if (!HasReadout(run.cameras)) return;
  std::vector<int64_t> stamps;
  for (const ImageDetections& image : *images) {
    const BodyCamera* camera = RollingCamera(run, image.camera);
    stamps.push_back(camera != nullptr ? BodyStamp(image.stamp_ns, *camera) : image.stamp_ns);
  }
  const std::vector<MotionRate> rates = RatesAt(run.odometry, stamps);
  for (size_t i = 0; i < images->size(); ++i) {
    ImageDetections& image = (*images)[i];
    const BodyCamera* camera = RollingCamera(run, image.camera);
    if (camera == nullptr) continue;
    const MotionRate rate = RateOfCamera(rates[i], camera->cam_from_body);
    for (TagDetection& tag : image.detections) {
      const double inverse = InverseDistance(camera->camera, tag, sizes.SizeOf(tag.id));
      for (Eigen::Vector2d& corner : tag.corners) {
        corner = PixelAtImageTime(camera->camera, camera->readout_s, corner, rate, inverse);
      }
    }
  }
}

}  // namespace trigpoint
