// How well a survey repeats: maps of fewer runs and of single days, compared.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "survey/tags/map_compare.h"

namespace trigpoint {

struct MapRepeats {
  std::optional<Repeatability> repeatability;    // maps of all runs but one, against the map of all
  std::map<std::string, Repeatability> without;  // of each run: the map without it, against the map of all
  std::optional<Repeatability> reproducibility;  // maps of single days, against each other
};

// Maps of all runs but one with all photo sets, days without them; `whole` is the map of all. A part that cannot be
// mapped by itself is left out. Nothing of fewer than two runs. Throws Cancelled.
MapRepeats RepeatMap(const SurveyInput& input, const SurveyOptions& options, const SurveyResult& whole, int threads,
                     ProgressSink& progress, const CancelToken& cancel);

}  // namespace trigpoint
