// The scene's pictures for the report.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/report/document.h"
#include "eval/report/report_data.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// The plan, drawn, over the aerial image; rendered as thumbnails: oblique by height, track length and uncertainty, and
// some stations. `unit` of the plan; `width` of a rendered one, px. `images` false: no photographs, no aerial image.
// Without OpenGL a paragraph says so in their place; `renderer` names the device.
struct Scenes {
  std::optional<Figure> plan;  // none without results
  std::vector<Block> pictures;
};
Scenes DrawScenes(const ReportInput& input, const DisplayUnit& unit, bool images, int width,
                  std::vector<std::string>* notes, std::string* renderer, ProgressSink& progress,
                  const CancelToken& cancel);

}  // namespace trigpoint
