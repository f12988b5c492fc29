#include "datasets/project/result_part.h"

#include <fmt/format.h>

#include <cstdio>
#include <string_view>

namespace trigpoint {

std::string PartName(const ResultPart& part) {
  return part.count == 1 ? "" : fmt::format("{:03}of{:03}", part.number, part.count);
}

std::optional<ResultPart> ParsePartName(const std::string& name) {
  ResultPart part;
  if (name.empty()) return part;
  const bool read = std::sscanf(name.c_str(), "%uof%u", &part.number, &part.count) == 2;
  if (!read || part.number >= part.count || PartName(part) != name) return std::nullopt;
  return part;
}

std::optional<ResultPart> PartOfResult(const std::string& result) {
  constexpr std::string_view kStage = "references";
  if (result == kStage) return ResultPart();
  if (!result.starts_with(kStage) || result.size() < kStage.size() + 2 || result[kStage.size()] != '@')
    return std::nullopt;
  return ParsePartName(result.substr(kStage.size() + 1));
}

}  // namespace trigpoint
