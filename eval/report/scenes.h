// The scene's pictures for the report.
#pragma once

#include <string>
#include <vector>

#include "eval/report/document.h"
#include "eval/report/report_data.h"

namespace trigpoint {

// Plan (over the aerial image), oblique by height, track length and uncertainty, and some stations. `width` of a
// picture, px. `images` false: no photographs, no aerial image. Without OpenGL a paragraph says so in their place;
// `renderer` names the device.
std::vector<Block> DrawScenes(const ReportInput& input, bool images, int width, std::vector<std::string>* notes,
                              std::string* renderer, ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
