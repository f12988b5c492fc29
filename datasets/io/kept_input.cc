#include "datasets/io/kept_input.h"

#include <ctime>
#include <set>

#include "datasets/io/lines.h"
#include "datasets/io/text.h"

namespace trigpoint {

namespace fs = std::filesystem;

fs::path KeepInputFile(const fs::path& site, const std::string& name) {
  if (!fs::exists(site / name)) return {};
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char time[32];
  std::strftime(time, sizeof time, "%Y-%m-%dT%H-%M-%SZ", &utc);
  const fs::path folder = site / "results" / "replaced";
  fs::path kept = folder / (std::string(time) + "-" + name);
  for (int k = 2; fs::exists(kept); ++k) kept = folder / (std::string(time) + "-" + std::to_string(k) + "-" + name);
  WriteFileAtomically(kept, ReadTextFile(site / name));
  return kept;
}

std::vector<std::string> AddedLines(const fs::path& kept, const fs::path& file) {
  const std::string old = ReadTextFile(kept), now = ReadTextFile(file);
  std::multiset<std::string_view> before;
  for (const std::string_view line : Lines(old)) before.insert(line);
  std::vector<std::string> added;
  for (const std::string_view line : Lines(now)) {
    if (const auto same = before.find(line); same != before.end()) {
      before.erase(same);
    } else if (!Trim(line).empty()) {
      added.emplace_back(line);
    }
  }
  return added;
}

}  // namespace trigpoint
