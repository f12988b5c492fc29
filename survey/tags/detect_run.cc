#include "survey/tags/detect_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <utility>

#include "calib/base/error.h"
#include "calib/base/parallel.h"
#include "datasets/io/image.h"
#include "datasets/io/mask.h"
#include "datasets/io/picture_parts.h"
#include "datasets/io/tag_families.h"
#include "survey/tags/detect_apart.h"
#include "survey/tags/tag_finder.h"

namespace trigpoint {
namespace {

constexpr int kNamedImages = 10;  // of those that cannot be used, so that a log stays readable

void DrawOverlay(const Run& run, const ImageEntry& image, const ImageDetections& found,
                 const std::filesystem::path& file) {
  cv::Mat picture;
  cv::cvtColor(LoadGrey(run, image), picture, cv::COLOR_GRAY2BGR);
  for (const TagDetection& tag : found.detections) {
    std::vector<cv::Point> corners;
    for (const Eigen::Vector2d& c : tag.corners) corners.emplace_back(cvRound(c.x()), cvRound(c.y()));
    cv::polylines(picture, corners, true, {0, 200, 0}, 1, cv::LINE_AA);
    cv::line(picture, corners[0], corners[1], {0, 0, 255}, 2, cv::LINE_AA);  // the tag's lower edge
    cv::putText(picture, std::to_string(tag.id), corners[3], cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 200, 255}, 1,
                cv::LINE_AA);
  }
  std::filesystem::create_directories(file.parent_path());
  bool written = false;
  try {
    written = cv::imwrite(file.string(), picture);
  } catch (const cv::Exception&) {  // the same to a user: named below
  }
  if (!written) throw IoError(file.string() + ": cannot be written");
}

// In a process of its own, so that a detector that dies of memory fails this stage and nothing else.
DetectTagsResult DetectImages(const Run& run, const DetectTagsOptions& options, StageContext& context) {
  const auto entry = [&](int64_t i) -> const ImageEntry& { return run.images[static_cast<size_t>(i)]; };
  double pixels = 0;
  for (const BodyCamera& camera : run.cameras) {
    pixels = std::max(pixels, static_cast<double>(camera.camera.width()) * camera.camera.height());
  }
  DetectedApart found = DetectTagsApart(
      "run " + run.name, pixels, static_cast<int64_t>(run.images.size()),
      [&](int64_t i) { return LoadGrey(run, entry(i)); },
      [&](int64_t i) -> const Camera* {
        const auto index = static_cast<size_t>(entry(i).camera);
        return index < run.cameras.size() ? &run.cameras[index].camera : nullptr;
      },
      options, context.threads, context.progress, context.cancel);
  context.metrics["detector_peak_memory_bytes"] = found.peak_memory_bytes;
  return std::move(found.tags);
}

int64_t LeaveOutMasked(const Run& run, std::vector<ImageTags>* images) {
  const RunMasks masks(run);
  int64_t left_out = 0;
  for (size_t i = 0; i < images->size(); ++i) {
    std::vector<TagDetection>& found = (*images)[i].detections;
    if (found.empty()) continue;
    const cv::Mat mask = masks.Of(run.images[i]);
    left_out +=
        static_cast<int64_t>(std::erase_if(found, [&](const TagDetection& tag) { return IsMasked(tag, mask); }));
  }
  return left_out;
}

// The views of a 360 picture overlap: a tag that two of them see was seen once. The view that looks at it most directly
// keeps it.
int64_t LeaveOutRepeated(const Run& run, std::vector<ImageTags>* images) {
  struct Sight {
    size_t image = 0;
    double off_axis = 0;
  };
  const auto camera_of = [&](size_t i) -> const BodyCamera* {
    const auto camera = static_cast<size_t>(run.images[i].camera);
    return camera < run.cameras.size() ? &run.cameras[camera] : nullptr;
  };
  const auto of_view = [&](size_t i) { return camera_of(i) && camera_of(i)->part.kind == PicturePart::Kind::kView; };
  const auto off_axis = [&](size_t i, const TagDetection& tag) {
    const Eigen::Vector2d centre = 0.25 * (tag.corners[0] + tag.corners[1] + tag.corners[2] + tag.corners[3]);
    const Camera& camera = camera_of(i)->camera;
    return (centre - 0.5 * Eigen::Vector2d(camera.width() - 1, camera.height() - 1)).norm();
  };
  std::map<std::tuple<int64_t, std::string, int>, Sight> best;
  for (size_t i = 0; i < images->size(); ++i) {
    if (!of_view(i)) continue;
    for (const TagDetection& tag : (*images)[i].detections) {
      const Sight sight{i, off_axis(i, tag)};
      const auto [it, fresh] = best.try_emplace({run.images[i].stamp_ns, PictureOf(run, run.images[i]), tag.id}, sight);
      if (!fresh && sight.off_axis < it->second.off_axis) it->second = sight;
    }
  }
  size_t left_out = 0;
  for (size_t i = 0; i < images->size(); ++i) {
    if (!of_view(i)) continue;
    left_out += std::erase_if((*images)[i].detections, [&](const TagDetection& tag) {
      return best.at({run.images[i].stamp_ns, PictureOf(run, run.images[i]), tag.id}).image != i;
    });
  }
  return static_cast<int64_t>(left_out);
}

}  // namespace

std::vector<ImageDetections> DetectInRun(const Run& run, const DetectTagsOptions& options, StageContext& context) {
  const auto count = static_cast<int64_t>(run.images.size());
  if (count == 0) {
    throw InputError(run.dir.string() + ": found no images; expected images.txt with its pictures, or a video");
  }
  CheckMasks(run, context.threads, context.progress, context.cancel);
  DetectTagsResult result = DetectImages(run, options, context);
  context.metrics["masked"] = LeaveOutMasked(run, &result.images);
  context.metrics["repeated"] = LeaveOutRepeated(run, &result.images);
  std::vector<ImageDetections> images;
  int named = 0;
  for (int64_t i = 0; i < count; ++i) {
    const ImageTags& tags = result.images[static_cast<size_t>(i)];
    if (!tags.usable && named++ < kNamedImages) context.progress.Log(LogLevel::kWarning, tags.problem);
    const ImageEntry& entry = run.images[static_cast<size_t>(i)];
    const auto camera = static_cast<size_t>(entry.camera);
    images.push_back(
        {entry.stamp_ns, entry.file, camera < run.cameras.size() ? run.cameras[camera].name : "cam0", tags.detections});
  }
  if (named > kNamedImages) {
    context.progress.Log(LogLevel::kWarning,
                         fmt::format("and {} more images that cannot be used", named - kNamedImages));
  }
  if (result.unusable == count) {
    throw InputError(run.dir.string() + ": none of its images can be used; the first: " + result.images[0].problem);
  }
  context.metrics["images"] = count;
  context.metrics["images_unusable"] = result.unusable;
  context.metrics["refused"] = result.refused;
  context.metrics["unrefined"] = result.unrefined;
  return images;
}

void WriteOverlays(const Run& run, const std::vector<ImageDetections>& images, const std::filesystem::path& dir,
                   int threads, ProgressSink& progress, const CancelToken& cancel) {
  progress.Begin("drawing overlays", static_cast<int64_t>(images.size()));
  ParallelFor(static_cast<int64_t>(images.size()), threads, cancel, [&](int64_t i) {
    const ImageDetections& found = images[static_cast<size_t>(i)];
    if (!found.detections.empty()) {
      DrawOverlay(run, run.images[static_cast<size_t>(i)], found, dir / fmt::format("{:06}.jpg", i));
    }
    progress.Advance(1);
  });
}

void LeaveOutOtherFamilies(const Run& run, const std::string& families, ProgressSink& progress,
                           std::vector<ImageDetections>* images) {
  const TagFamilies wanted(families);
  size_t all = 0, others = 0;
  std::string other;
  for (ImageDetections& image : *images) {
    all += image.detections.size();
    others += std::erase_if(image.detections, [&](const TagDetection& d) {
      if (d.family == wanted.Of(d.id)) return false;
      other = d.family;
      return true;
    });
  }
  if (others == 0) return;
  const std::string found = fmt::format("{}: {} of {} detections are of family {}, tags.yaml has {}",
                                        run.detections.string(), others, all, other, families);
  if (others == all) throw InputError(found + "; correct the family in one of the two");
  progress.Log(LogLevel::kWarning, found + "; they are left out");
}

}  // namespace trigpoint
