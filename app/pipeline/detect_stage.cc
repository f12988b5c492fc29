// detect: the tags in every image of a run.
#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "app/pipeline/reference_tags.h"
#include "app/pipeline/stage_list.h"
#include "calib/base/parallel.h"
#include "datasets/io/image.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {
namespace {

struct DetectOptions {
  DetectTagsOptions detector;
  bool overlays = false;  // write a picture of what was found, for every image with a tag
  template <typename Self, typename Visitor>
  static void Visit(Self& self, Visitor&& visit) {
    DetectTagsOptions::Visit(self.detector, visit);
    visit(self.overlays, {"overlays", "", 0, 1, "write overlays/: each image with a tag, and what was found in it"});
  }
  std::vector<std::string> Check() const { return detector.Check(); }
};

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

std::vector<ImageDetections> DetectInImages(const Run& run, const DetectOptions& options, StageContext& context) {
  const auto count = static_cast<int64_t>(run.images.size());
  if (count == 0) {
    throw InputError(run.dir.string() + ": found no images; expected images.txt with its pictures, or a video");
  }
  const auto entry = [&](int64_t i) -> const ImageEntry& { return run.images[static_cast<size_t>(i)]; };
  const auto camera = [&](int64_t i) -> const BodyCamera* {
    const auto index = static_cast<size_t>(entry(i).camera);
    return index < run.cameras.size() ? &run.cameras[index] : nullptr;
  };
  const DetectTagsResult result = DetectTags(
      count, [&](int64_t i) { return LoadGrey(run, entry(i)); },
      [&](int64_t i) { return camera(i) != nullptr ? &camera(i)->camera : nullptr; }, options.detector, context.threads,
      context.progress, context.cancel);
  std::vector<ImageDetections> images;
  int named = 0;
  for (int64_t i = 0; i < count; ++i) {
    const ImageTags& tags = result.images[static_cast<size_t>(i)];
    if (!tags.usable && named++ < kNamedImages) context.progress.Log(LogLevel::kWarning, tags.problem);
    images.push_back(
        {entry(i).stamp_ns, entry(i).file, camera(i) != nullptr ? camera(i)->name : "cam0", tags.detections});
  }
  if (named > kNamedImages) {
    context.progress.Log(LogLevel::kWarning,
                         fmt::format("and {} more images that cannot be used", named - kNamedImages));
  }
  if (named == count)
    throw InputError(run.dir.string() + ": none of its images can be used; the first: " + result.images[0].problem);
  context.metrics["images"] = count;
  context.metrics["images_unusable"] = result.unusable;
  context.metrics["refused"] = result.refused;
  context.metrics["unrefined"] = result.unrefined;
  if (options.overlays) {
    context.progress.Begin("drawing overlays", count);
    ParallelFor(count, context.threads, context.cancel, [&](int64_t i) {
      const ImageDetections& found = images[static_cast<size_t>(i)];
      if (!found.detections.empty()) {
        DrawOverlay(run, entry(i), found, context.out / "overlays" / fmt::format("{:06}.jpg", i));
      }
      context.progress.Advance(1);
    });
  }
  return images;
}

// The same number in another family is another tag.
void LeaveOutOtherFamilies(const Run& run, const std::string& family, StageContext& context,
                           std::vector<ImageDetections>* images) {
  size_t all = 0, others = 0;
  std::string other;
  for (ImageDetections& image : *images) {
    all += image.detections.size();
    others += std::erase_if(image.detections, [&](const TagDetection& d) {
      if (d.family == family) return false;
      other = d.family;
      return true;
    });
  }
  if (others == 0) return;
  const std::string found = fmt::format("{}: {} of {} detections are of family {}, tags.yaml says {}",
                                        run.detections.string(), others, all, other, family);
  if (others == all) throw InputError(found + "; mend one of the two");
  context.progress.Log(LogLevel::kWarning, found + "; they are left out");
}

DetectOptions OptionsFor(const Project& project, const StageTarget& target) {
  DetectOptions options = ResolveOptions<DetectOptions>(project, "detect", target);
  // tags.yaml says which family is out there, unless an option does.
  bool named = false;
  for (const OptionLayer& layer : OptionLayers(project, "detect", target)) named |= layer.values.contains("family");
  if (!named) options.detector.family = project.site().tags.family;
  return options;
}

}  // namespace

DetectTagsOptions DetectorOptions(const Project& project, const StageTarget& target) {
  return OptionsFor(project, target).detector;
}

StageInfo DetectStage() {
  StageInfo info;
  info.name = "detect";
  info.help = "find the tags in every image of a run";
  info.metric = "detections";
  UseOptions<DetectOptions>(info);
  info.make = [](const Project& project, const StageTarget& target) {
    const DetectOptions options = OptionsFor(project, target);
    StageRequest request;
    request.options = JsonFromOptions(options);
    request.inputs = RunInputs(project, project.run(target.run));
    request.body = [options, name = target.run](StageContext& context) {
      const Run& run = context.project.run(name);
      std::vector<ImageDetections> images;
      if (run.detections.empty()) {
        images = DetectInImages(run, options, context);
      } else {
        std::vector<std::string> warnings;
        images = ReadDetections(run.detections, options.detector.raw_sigma_px, &warnings);
        for (const std::string& warning : warnings) context.progress.Log(LogLevel::kWarning, warning);
        LeaveOutOtherFamilies(run, options.detector.family, context, &images);
      }
      int64_t detections = 0;
      std::set<int> ids;
      for (const ImageDetections& image : images) {
        detections += static_cast<int64_t>(image.detections.size());
        for (const TagDetection& tag : image.detections) ids.insert(tag.id);
      }
      WriteDetections(context.out / "detections.csv", images);
      context.metrics["detections"] = detections;
      context.metrics["tags"] = ids.size();
    };
    return request;
  };
  info.summary = [](const StageOutcome& outcome, const DisplayUnit&) {
    const nlohmann::json& metrics = outcome.manifest.at("metrics");
    return fmt::format("{} detections of {} tags: {}\n", metrics.value("detections", 0), metrics.value("tags", 0),
                       (outcome.dir / "detections.csv").string());
  };
  return info;
}

}  // namespace trigpoint
