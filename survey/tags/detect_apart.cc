#include "survey/tags/detect_apart.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "calib/base/memory.h"
#include "calib/base/parallel.h"
#include "datasets/project/forked.h"
#include "survey/tags/detection_json.h"

namespace trigpoint {
namespace {

// Exact, unlike detections.csv: the result does not depend on the process it was computed in.
std::string Packed(const DetectTagsResult& result) {
  nlohmann::json images = nlohmann::json::array();
  for (const ImageTags& image : result.images) {
    nlohmann::json tags = nlohmann::json::array();
    for (const TagDetection& t : image.detections) tags.push_back(JsonOf(t));
    images.push_back({image.usable, image.problem, tags});
  }
  std::string bytes;
  nlohmann::json::to_cbor({images, result.unusable, result.detections, result.refused, result.unrefined}, bytes);
  return bytes;
}

DetectTagsResult Unpacked(const std::string& bytes) {
  const nlohmann::json all = nlohmann::json::from_cbor(bytes);
  DetectTagsResult result;
  for (const nlohmann::json& i : all.at(0)) {
    ImageTags image;
    image.usable = i.at(0);
    image.problem = i.at(1);
    for (const nlohmann::json& t : i.at(2)) image.detections.push_back(DetectionOf(t));
    result.images.push_back(std::move(image));
  }
  result.unusable = all.at(1);
  result.detections = all.at(2);
  result.refused = all.at(3);
  result.unrefined = all.at(4);
  return result;
}

// Workers that the free memory allows.
int WorkersWithin(const std::string& what, double pixels, const DetectTagsOptions& options, int threads) {
  // By the detector's structures: labels of 8 bytes, copies of 1 byte, and up to four points of 12 bytes a border
  // pixel, in arrays that grow twofold. Border pixels are taken as half of all.
  constexpr double kBytesPerPixel = 64, kFixedBytes = 96 << 20;
  const double searched = pixels / (options.quad_decimate * options.quad_decimate);
  const double each = std::max(1.0, kBytesPerPixel * searched + 4 * pixels);  // and the picture as it is read
  const auto available = static_cast<double>(AvailableMemoryBytes());
  const int workers = static_cast<int>(std::min<double>((available - kFixedBytes) / each, ResolveThreads(threads)));
  if (workers >= 1) return workers;
  constexpr double kMiB = 1 << 20;
  throw Error(fmt::format(
      "{}: detecting tags in images of {:.1f} megapixels needs about {:.0f} MiB of memory, {:.0f} MiB are free; "
      "free some, raise its limit (ulimit -v), or use a larger quad_decimate",
      what, pixels * 1e-6, (each + kFixedBytes) / kMiB, available / kMiB));
}

}  // namespace

DetectedApart DetectTagsApart(const std::string& what, double pixels, int64_t count, const PictureSource& picture,
                              const CameraSource& camera, const DetectTagsOptions& options, int threads,
                              ProgressSink& progress, const CancelToken& cancel) {
  const int workers = WorkersWithin(what, pixels, options, threads);
  const ForkedResult forked = RunForked(
      what + ": detecting tags",
      [&](ProgressSink& its) { return Packed(DetectTags(count, picture, camera, options, workers, its, cancel)); },
      progress, cancel);
  return {Unpacked(forked.bytes), forked.peak_memory_bytes};
}

}  // namespace trigpoint
