// When pictures were taken, as far as their sources say: "2024", "2024-05", "2024-05-12T09:43:20Z".
#pragma once

#include <optional>
#include <string>

#include "datasets/io/site.h"

namespace trigpoint {

struct CaptureGap {
  double years = 0;        // of the picture after the run; negative: before
  double season_days = 0;  // between their days of the year, 0 to 183
};

// Between a picture and a run; nothing unless both state at least year and month.
std::optional<CaptureGap> GapBetween(const std::string& picture, const std::string& run);

// "taken 2019-01, 7.3 years before the run, in another season"; "" where nothing is to be explained: less than a year
// apart and in the same season.
std::string ExplainGap(const std::string& picture, const std::string& run);

// The day of a run: of run.yaml, else of its first image where its clock is on UTC; "" where neither is known.
std::string DateOfRun(const Run& run);

// "2026-05-12T09:43:20Z" of seconds since 1970.
std::string UtcOfSeconds(int64_t seconds);

}  // namespace trigpoint
