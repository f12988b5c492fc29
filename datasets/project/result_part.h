// A large site's references are made in parts, each a result of its own: results/references@003of016.
#pragma once

#include <optional>
#include <string>

namespace trigpoint {

// Of `count` parts the one with this number.
struct ResultPart {
  unsigned number = 0, count = 1;
};

// "003of016"; empty where there is one part only.
std::string PartName(const ResultPart& part);
// Nothing for a name that PartName does not make.
std::optional<ResultPart> ParsePartName(const std::string& name);
// Of the name of a folder in results: "references", "references@003of016". Nothing for any other, so that a variant may
// have any name.
std::optional<ResultPart> PartOfResult(const std::string& result);

}  // namespace trigpoint
