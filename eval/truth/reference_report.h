// A run's reference poses in words and in numbers.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/text/display_unit.h"
#include "eval/truth/reference_poses.h"

namespace trigpoint {

// The images of a run of which only detections were brought.
std::vector<ImageEntry> ImagesOfDetections(const std::vector<ImageDetections>& detections,
                                           const std::vector<BodyCamera>& cameras);

// `evidence`: what the poses rest on, one name each.
std::string ReferenceText(const ReferencePoses& result, const std::vector<std::string>& evidence,
                          const DisplayUnit& unit);
nlohmann::json ReferenceMetrics(const ReferencePoses& result, const std::vector<std::string>& evidence);

}  // namespace trigpoint
