// The report's chapters, each a function that adds its blocks.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "eval/errors/evaluation_files.h"
#include "eval/report/document.h"
#include "eval/report/report_data.h"

namespace trigpoint {

// What every chapter needs.
struct ChapterContext {
  const ReportInput& input;
  const ReportData& data;
  const DisplayUnit& unit;
  std::map<std::string, std::string> station_anchor;  // station -> anchor of its section
  std::map<std::string, Figure> match_figures;        // "run@variant/panorama"
  bool alone = false;                                 // one chapter is shown by itself: it must not point to others

  std::string Length(const std::optional<double>& metres, int decimals = 3) const;      // "" if not given; without unit
  std::string LengthUnit(const std::optional<double>& metres, int decimals = 3) const;  // with unit
  TableCell LengthCell(const std::optional<double>& metres, int decimals = 3) const;
  // "run1", "run1@paper": as the folders of results are called.
  std::string RunName(const std::string& run, const std::string& variant) const { return ResultNameOf(run, variant); }
};

// The number a reader takes away: absolute before relative, independent before shared evidence, our own before G1.
struct Headline {
  const VariantData* variant = nullptr;
  nlohmann::json group;  // of summary.json; null: there is none
};
Headline FindHeadline(const ReportData& data);

// The groups of all evaluations, our own answers before G1, the first variant before others, absolute and independent
// before relative and shared.
std::vector<nlohmann::json> Groups(const ReportData& data);
// For files and addresses: "single against control, absolute [variant paper]".
std::string GroupName(const nlohmann::json& group);
// For people: "panorama (G2) against surveyed control, absolute [, variant paper]".
std::string GroupTitle(const nlohmann::json& group);
std::string GroupTitle(const std::string& method, const std::string& reference, const std::string& kind,
                       bool shares_evidence, const std::string& variant);
// Names an answer.
std::string CellKey(const std::string& run, const std::string& variant, const std::string& panorama);
// Answers in the order in which their pictures are wanted.
std::vector<const ErrorRecord*> WorstFirst(const ReportData& data);

// The first screen: what this is, how good it is, where, and the three worst things. `plan` may be empty.
void AddVerdict(const ChapterContext& context, std::optional<Figure> plan, std::vector<Block>* blocks);
// How good the answers are in more words: gates, the headline's comparison, every method beside it, the worst cells.
void AddSummary(const ChapterContext& context, std::vector<Block>* blocks);
void AddAccuracy(const ChapterContext& context, std::vector<Block>* blocks);
void AddConsistency(const ChapterContext& context, std::vector<Block>* blocks);
void AddRuns(const ChapterContext& context, std::vector<Block>* blocks);
// Nothing without stitched sets. `images` false: numbers only.
void AddStitched(const ChapterContext& context, bool images, std::vector<Block>* blocks);
// Cameras and other trajectories against the reference poses; nothing without them.
void AddCameras(const ChapterContext& context, std::vector<Block>* blocks);
// The tag map against surveyed points; nothing without one.
void AddSurvey(const ChapterContext& context, std::vector<Block>* blocks);
// Nothing without results of calibrate, crosscheck.
void AddCalibrations(const ChapterContext& context, std::vector<Block>* blocks);
void AddCrosschecks(const ChapterContext& context, std::vector<Block>* blocks);
void AddStations(const ChapterContext& context, std::vector<Block>* blocks);
void AddProvenance(const ChapterContext& context, std::vector<Block>* blocks);

}  // namespace trigpoint
