#include "eval/text/markdown.h"

#include <fmt/format.h>

#include <algorithm>

namespace trigpoint {

std::string AlignMarkdown(const std::vector<std::vector<std::string>>& lines) {
  std::vector<size_t> width(lines.front().size(), 3);
  for (const auto& line : lines) {
    for (size_t c = 0; c < line.size(); ++c) width[c] = std::max(width[c], line[c].size());
  }
  std::string text;
  for (size_t r = 0; r < lines.size(); ++r) {
    text += "|";
    for (size_t c = 0; c < lines[r].size(); ++c) {
      text +=
          c == 0 ? fmt::format(" {:<{}} |", lines[r][c], width[c]) : fmt::format(" {:>{}} |", lines[r][c], width[c]);
    }
    text += "\n";
    if (r > 0) continue;
    text += "|";
    for (size_t c = 0; c < width.size(); ++c) text += std::string(width[c] + 1, '-') + (c == 0 ? "-|" : ":|");
    text += "\n";
  }
  return text;
}

}  // namespace trigpoint
