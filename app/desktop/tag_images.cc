#include "app/desktop/tag_images.h"

#include <algorithm>
#include <map>

#include "app/pipeline/stages.h"
#include "datasets/io/csv.h"
#include "datasets/io/text.h"
#include "survey/tags/tag_files.h"

namespace trigpoint {

namespace {

std::map<std::string, double> ResidualsOf(const Project& project, int tag_id) {
  std::map<std::string, double> residuals;  // by RUN/FILE
  const std::filesystem::path file = ResultOf(project, "survey", {}) / "residuals.csv";
  if (!std::filesystem::exists(file)) return residuals;
  const CsvTable table = CsvTable::Read(file, {"run", "image", "tag_id", "rms_px"});
  table.ForEachUsable(nullptr, [&](const CsvRow& row) {
    if (row.Integer("tag_id") != tag_id || !row.Has("image") || !row.Has("rms_px")) return;
    residuals[row.Text("run") + "/" + row.Text("image")] = row.Number("rms_px");
  });
  return residuals;
}

}  // namespace

std::vector<TagImage> ImagesOfTag(const Project& project, int tag_id, TagImageOrder order) {
  const std::map<std::string, double> residuals = ResidualsOf(project, tag_id);
  std::vector<TagImage> images;
  for (const Run& run : project.site().runs) {
    StageTarget target;
    target.run = run.name;
    const std::filesystem::path file = ResultOf(project, "detect", target) / "detections.csv";
    if (!std::filesystem::exists(file)) continue;
    std::vector<std::string> warnings;
    for (const ImageDetections& image : ReadDetections(file, 0.2, &warnings)) {
      for (const TagDetection& tag : image.detections) {
        if (tag.id != tag_id) continue;
        TagImage seen;
        seen.image = run.name + "/" + image.image;
        seen.side_px = (tag.corners[0] - tag.corners[2]).norm();
        if (const auto it = residuals.find(seen.image); it != residuals.end()) seen.rms_px = it->second;
        images.push_back(std::move(seen));
      }
    }
  }
  const auto key = [order](const TagImage& image) {
    return order == TagImageOrder::kLargest ? image.side_px : image.rms_px.value_or(-1);
  };
  std::stable_sort(images.begin(), images.end(), [&](const auto& a, const auto& b) { return key(a) > key(b); });
  return images;
}

}  // namespace trigpoint
