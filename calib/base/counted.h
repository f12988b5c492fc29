// Counts with their nouns, and lists that end in a count.
#pragma once

#include <concepts>
#include <cstddef>
#include <string>
#include <vector>

namespace trigpoint {

// "1 run", "4 panoramas"; the plural, where it isn't the singular with an s: "2 batches".
inline std::string Counted(std::integral auto count, const std::string& one, const std::string& many = "") {
  return std::to_string(count) + " " + (count == 1 ? one : many.empty() ? one + "s" : many);
}

// "run1, run2, run3 and 9 more".
inline std::string Listed(const std::vector<std::string>& names, size_t most = 6) {
  std::string text;
  for (size_t k = 0; k < names.size() && k < most; ++k) {
    if (k > 0) text += ", ";
    text += names[k];
  }
  if (names.size() > most) text.append(" and ").append(std::to_string(names.size() - most)).append(" more");
  return text;
}

}  // namespace trigpoint
