// detect: the tags in every image of a run.
#include "app/pipeline/detect_stage.h"

#include <fmt/format.h>

#include <set>

#include "app/pipeline/stage_list.h"
#include "calib/base/counted.h"
#include "survey/tags/detect_run.h"
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

DetectOptions OptionsFor(const Project& project, const StageTarget& target) {
  DetectOptions options = ResolveOptions<DetectOptions>(project, "detect", target);
  // The family is that of tags.yaml, unless an option names one.
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
    request.version = 6;
    request.options = JsonFromOptions(options);
    request.inputs = RunInputs(project, project.run(target.run));
    request.body = [options, name = target.run](StageContext& context) {
      const Run& run = context.project.run(name);
      std::vector<ImageDetections> images;
      if (run.detections.empty()) {
        images = DetectInRun(run, options.detector, context);
        if (options.overlays) {
          WriteOverlays(run, images, context.out / "overlays", context.threads, context.progress, context.cancel);
        }
      } else {
        std::vector<std::string> warnings;
        images = ReadDetections(run.detections, options.detector.raw_sigma_px, &warnings);
        for (const std::string& warning : warnings) context.progress.Log(LogLevel::kWarning, warning);
        LeaveOutOtherFamilies(run, options.detector.family, context.progress, &images);
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
    return fmt::format("{} of {}: {}\n", Counted(metrics.value("detections", 0), "detection"),
                       Counted(metrics.value("tags", 0), "tag"), (outcome.dir / "detections.csv").string());
  };
  return info;
}

}  // namespace trigpoint
