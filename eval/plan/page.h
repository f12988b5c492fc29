// What a plan is written to: tables, a map, a page, a summary.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "eval/plan/findings.h"
#include "eval/text/display_unit.h"

namespace trigpoint {

// tags.csv, cameras.csv, stations.csv, observations.csv, known_points.csv, gains.csv, suggestions.csv, summary.json,
// map.svg, map.png, index.html
void WritePlan(const PlanFindings& findings, const std::filesystem::path& folder);
// At most 12 lines.
std::string PlanSummary(const nlohmann::json& summary, const DisplayUnit& unit);

}  // namespace trigpoint
