// Counts with their nouns.
#pragma once

#include <concepts>
#include <string>

namespace trigpoint {

// "1 run", "4 panoramas"; the plural, where it isn't the singular with an s: "2 batches".
inline std::string Counted(std::integral auto count, const std::string& one, const std::string& many = "") {
  return std::to_string(count) + " " + (count == 1 ? one : many.empty() ? one + "s" : many);
}

}  // namespace trigpoint
