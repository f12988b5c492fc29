// What `survey` tells: report_<unit>.md for people, summary.json for programs.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "app/pipeline/survey_input.h"
#include "eval/text/display_unit.h"
#include "survey/tags/map_compare.h"
#include "survey/tags/station_offset.h"

namespace trigpoint {

struct SurveyFindings {
  std::string frame = "enu";  // of the map: enu; local: a surveyor's own, without a place on the Earth; map: its own
  std::string check_note;
  ControlSystems control;
  std::vector<std::string> photo_sets;  // that took part
  bool nssda = false;
  std::optional<Repeatability> repeatability;  // maps of all runs but one, against the map of all
  std::map<std::string, Repeatability>
      repeatability_without;                     // of each run: the map without it, against the map of all
  std::map<std::string, std::string> sessions;   // date of each run that has one
  std::optional<Repeatability> reproducibility;  // maps of single days, against each other
  std::optional<SurveyEpochs> epochs;
  std::string against;  // name of the other survey
  std::vector<StationOffset> stations;
};

// used, taken out, not used; check, moved.
std::string StatusOf(const PointAgreement& point);

nlohmann::json SurveySummary(const SurveyResult& result, const SurveyFindings& findings);
std::string FormatSurvey(const SurveyResult& result, const SurveyFindings& findings, const DisplayUnit& unit);

}  // namespace trigpoint
