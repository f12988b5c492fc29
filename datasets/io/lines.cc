#include "datasets/io/lines.h"

#include <algorithm>

#include "datasets/io/text.h"

namespace trigpoint {

std::vector<std::string_view> Lines(std::string_view text) {
  std::vector<std::string_view> lines;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return lines;
}

std::vector<DataLine> DataLines(std::string_view text, std::vector<std::string_view>* comments) {
  std::vector<DataLine> lines;
  int number = 0;
  for (const std::string_view whole : Lines(text)) {
    ++number;
    const std::string_view line = Trim(whole);
    if (line.starts_with('#')) {
      if (comments != nullptr) comments->push_back(line.substr(1));
    } else if (!line.empty()) {
      lines.push_back({line, number});
    }
  }
  return lines;
}

bool HasKittiRows(std::string_view text) {
  constexpr size_t kNumbers = 12;
  const std::vector<DataLine> lines = DataLines(text);
  if (lines.empty() || lines.front().text.find(',') != std::string_view::npos) return false;
  const auto fields = SplitFields(lines.front().text);
  return fields.size() == kNumbers &&
         std::all_of(fields.begin(), fields.end(), [](const auto& field) { return ParseDouble(field).has_value(); });
}

}  // namespace trigpoint
