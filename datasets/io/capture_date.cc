#include "datasets/io/capture_date.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>

#include "datasets/io/text.h"

namespace trigpoint {
namespace {

constexpr double kDaysPerYear = 365.2425;
constexpr double kOtherSeason_days = 60;

// Days since 1970; of a month its middle.
std::optional<double> DaysOf(const std::string& date) {
  constexpr size_t kMonth = 7, kDay = 10;  // characters
  if (date.size() < kMonth) return std::nullopt;
  const bool day = date.size() >= kDay;
  const auto ns = ParseUtcToNs((day ? date.substr(0, kDay) : date.substr(0, kMonth) + "-15") + "T00:00:00Z");
  if (!ns) return std::nullopt;
  return 1e-9 * static_cast<double>(*ns) / 86400;
}

}  // namespace

std::optional<CaptureGap> GapBetween(const std::string& picture, const std::string& run) {
  const auto taken = DaysOf(picture), driven = DaysOf(run);
  if (!taken || !driven) return std::nullopt;
  const double days = *taken - *driven;
  const double apart = std::abs(std::remainder(days, kDaysPerYear));
  return CaptureGap{days / kDaysPerYear, apart};
}

std::string ExplainGap(const std::string& picture, const std::string& run) {
  const auto gap = GapBetween(picture, run);
  if (!gap) return "";
  const bool years = std::abs(gap->years) >= 1, season = gap->season_days > kOtherSeason_days;
  if (!years && !season) return "";
  std::string text = "taken " + picture.substr(0, 7);
  if (years)
    text += fmt::format(", {:.1f} years {} the run", std::abs(gap->years), gap->years < 0 ? "before" : "after");
  if (season) text += ", in another season";
  return text;
}

std::string DateOfRun(const Run& run) {
  if (!run.config.date.empty()) return run.config.date;
  if (run.images.empty()) return "";
  constexpr int64_t kYear2000_s = 946'684'800, kNsPerS = 1'000'000'000;
  const int64_t first_s = (run.images.front().stamp_ns + run.config.time_zero_utc_ns.value_or(0)) / kNsPerS;
  return first_s > kYear2000_s ? UtcOfSeconds(first_s).substr(0, 10) : "";
}

std::string UtcOfSeconds(int64_t seconds) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(seconds)));
}

}  // namespace trigpoint
