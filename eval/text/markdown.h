// Markdown tables that read well on a terminal too.
#pragma once

#include <string>
#include <vector>

namespace trigpoint {

// `lines`: the header and the rows, equally many cells each; the first column to the left, the others to the right.
std::string AlignMarkdown(const std::vector<std::vector<std::string>>& lines);

}  // namespace trigpoint
