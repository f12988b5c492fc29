#include "eval/truth/reference_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "eval/statistics/statistics.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

int64_t Count(const ReferencePoses& result, const char* status) {
  return std::count_if(result.poses.begin(), result.poses.end(),
                       [&](const ReferencePose& pose) { return pose.status == status; });
}

}  // namespace

std::vector<ImageEntry> ImagesOfDetections(const std::vector<ImageDetections>& detections,
                                           const std::vector<BodyCamera>& cameras) {
  std::vector<ImageEntry> images;
  for (const ImageDetections& image : detections) {
    ImageEntry entry;
    entry.stamp_ns = image.stamp_ns;
    entry.file = image.image;
    for (size_t c = 0; c < cameras.size(); ++c) {
      if (cameras[c].name == image.camera) entry.camera = static_cast<int>(c);
    }
    images.push_back(std::move(entry));
  }
  return images;
}

std::string ReferenceText(const ReferencePoses& result, const std::vector<std::string>& evidence,
                          const DisplayUnit& unit) {
  const int64_t bridged = Count(result, "bridged"), none = Count(result, "none");
  std::vector<double> sigmas;
  for (const ReferencePose& pose : result.poses) {
    if (pose.world_from_cam) sigmas.push_back(std::sqrt(pose.covariance.bottomRightCorner<3, 3>().trace()));
  }
  std::string text = fmt::format("{} images: {} see tags", result.poses.size(), Count(result, "tags"));
  if (bridged > 0) text += fmt::format(", {} bridged by the run's motion", bridged);
  if (none > 0) text += fmt::format(", {} without a pose", none);
  text += "\n";
  if (!sigmas.empty()) {
    text += fmt::format(
        "1 sigma in space (east, north, up; the map's datum included): median {:.4f}, P90 {:.4f}, max "
        "{:.4f} {}\n",
        Quantile(sigmas, 0.5) / unit.metres, Quantile(sigmas, 0.9) / unit.metres, Quantile(sigmas, 1) / unit.metres,
        unit.name);
  }
  text += fmt::format(
      "{} detections of {} tags, {} left out; corners {:.3f} px rms; motion's scale {:.5f} +- {:.5f} (1 "
      "sigma), its noise {:.2f} (rotation) and {:.2f} (position) times the stated\n",
      result.sights, result.tags_used.size(), result.rejected, result.rms_px, result.scale, result.scale_sigma,
      result.motion_rot_factor, result.motion_m_factor);
  text += "Rests on:";
  for (const std::string& item : evidence) text += " " + item;
  return text + "\n";
}

nlohmann::json ReferenceMetrics(const ReferencePoses& result, const std::vector<std::string>& evidence) {
  return {{"images", result.poses.size()},     {"tags", Count(result, "tags")}, {"bridged", Count(result, "bridged")},
          {"none", Count(result, "none")},     {"rms_px", result.rms_px},       {"scale", result.scale},
          {"scale_sigma", result.scale_sigma}, {"rejected", result.rejected},   {"evidence", evidence}};
}

}  // namespace trigpoint
