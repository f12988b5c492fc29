#include "eval/text/number_text.h"

#include <fmt/format.h>

namespace trigpoint {

std::string NumberText(const std::optional<double>& value, int decimals, const char* missing, double unit) {
  return value ? fmt::format("{:.{}f}", *value / unit, decimals) : missing;
}

}  // namespace trigpoint
