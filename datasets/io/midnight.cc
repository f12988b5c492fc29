#include "datasets/io/midnight.h"

#include <fmt/format.h>

#include <algorithm>

#include "calib/base/error.h"

namespace trigpoint {

void RequireNoMidnight(const std::filesystem::path& file, const std::vector<int64_t>& stamps) {
  constexpr int64_t kSecond = 1'000'000'000, kDay = 86'400 * kSecond, kPause = 3600 * kSecond;
  const auto falls = std::is_sorted_until(stamps.begin(), stamps.end());
  if (falls == stamps.end() || *(falls - 1) >= kDay || *falls < 0) return;
  if (*falls + kDay - *(falls - 1) > kPause) return;  // two logs in one file
  if (!std::is_sorted(falls, stamps.end()) || stamps.back() > stamps.front()) return;
  throw InputError(
      fmt::format("{}: its times fall from {:.3f} to {:.3f} s: seconds of the day, which begin again after "
                  "midnight; expected times that rise: add 86400 to those after midnight, in all files",
                  file.string(), 1e-9 * static_cast<double>(*(falls - 1)), 1e-9 * static_cast<double>(*falls)));
}

}  // namespace trigpoint
