// Panoramas of a cross-check: those that we localized and those that we refused.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "datasets/colmap/model.h"
#include "eval/errors/crosscheck.h"
#include "eval/errors/results.h"

namespace trigpoint {

// Every panorama of `views` (image name -> panorama, index of its view), with our answer and theirs: the mean of its
// views' centres, weighted by the points that each sees. `changed`: answers that are not what was computed.
std::vector<CrossPanorama> PanoramasOf(const SparseModel& model,
                                       const std::map<std::string, std::pair<std::string, size_t>>& views,
                                       const std::vector<PanoramaResult>& answers,
                                       const std::set<std::string>& changed);

// Panoramas whose answer in a table is not that of the solution it was written from.
std::set<std::string> ChangedAnswers(const std::vector<PanoramaResult>& table,
                                     const std::vector<PanoramaResult>& computed);

// panoramas.csv: a row for each, frame odom.
void WritePanoramaVerdicts(const std::vector<PanoramaJudgement>& judged, const std::vector<PanoramaResult>& answers,
                           const std::filesystem::path& file);
// The same as Markdown, and for the manifest; empty without panoramas.
std::string FormatPanoramaVerdicts(const std::vector<PanoramaJudgement>& judged,
                                   const std::vector<PanoramaResult>& answers);
nlohmann::json PanoramaVerdictsJson(const std::vector<PanoramaJudgement>& judged,
                                    const std::vector<PanoramaResult>& answers);
// One sentence for each that contradicts or that we alone refused.
std::vector<std::string> PanoramaWarnings(const std::vector<PanoramaJudgement>& judged,
                                          const std::vector<PanoramaResult>& answers);

}  // namespace trigpoint
