// Results as layers of a map.
#pragma once

#include <string>
#include <vector>

#include "datasets/export/layers.h"
#include "eval/exchange/export.h"

namespace trigpoint {

// The layers of maps, in site ENU brought to the Earth. Missing results are named in `warnings`.
std::vector<Layer> MapLayers(const Project& project, const ExportRequest& request, std::vector<std::string>* warnings);

}  // namespace trigpoint
