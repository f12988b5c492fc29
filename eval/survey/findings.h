// What a survey's report tells beside its map.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "survey/input/job.h"
#include "survey/tags/map_compare.h"
#include "survey/tags/map_repeat.h"
#include "survey/tags/station_offset.h"

namespace trigpoint {

struct SurveyFindings {
  std::string frame = "enu";  // of the map: enu; local: a surveyor's own, without a place on the Earth; map: its own
  std::string check_note;
  ControlSystems control;
  std::vector<std::string> photo_sets;  // that took part
  bool nssda = false;
  MapRepeats repeats;
  std::map<std::string, std::string> sessions;  // date of each run that has one
  std::optional<SurveyEpochs> epochs;
  std::string against;  // name of the other survey
  std::vector<StationOffset> stations;
};

// used, taken out, not used; check, moved.
std::string StatusOf(const PointAgreement& point);

// The accuracy that is reported: differences at check points and the check points' own uncertainty in quadrature.
struct ReportedAccuracy {
  double h = 0, v = 0, d = 0;
};
ReportedAccuracy ReportedOf(const CheckSummary& check);

// ASPRS Positional Accuracy Standards, edition 2: least number of check points.
inline constexpr int kConformantChecks = 30;
// NSSDA (FGDC-STD-007.3): 95 % values from RMSE_r (both axes alike) and RMSE_z.
inline constexpr double kNssdaHorizontal = 1.7308, kNssdaVertical = 1.9600;

// The tags of another survey's tags.csv, with its tags_cov.csv beside it, against this one's. Throws InputError.
SurveyEpochs EpochsAgainst(const std::filesystem::path& file, const SurveyResult& result);

}  // namespace trigpoint
